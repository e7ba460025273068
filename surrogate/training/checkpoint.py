"""An interrupted training: everything needed to go on as if nothing had happened."""

import dataclasses
from pathlib import Path

import jax
import numpy as np
from jaxtyping import PyTree

from surrogate.devices import Partition, Sharded
from surrogate.errors import InvalidInput
from surrogate.leaves import read_header, read_leaves, write_leaves
from surrogate.processes import agreed, first, together
from surrogate.training.plan import Plan


def save_checkpoint(path: Path, plan: Plan, state: PyTree, partition: Partition) -> None:
    """Write the plan and all leaves of ``state`` in one file, whole or not at all.

    What is owned goes there in the order of the samples, whatever devices there are.
    """
    places = np.asarray(partition.places)
    state = _in_order(state, lambda rows: together(rows)[places])
    if first():
        write_leaves(path, state, _describe(plan))


def load_checkpoint(path: Path, plan: Plan, like: PyTree, partition: Partition) -> PyTree | None:
    """The saved state, shaped ``like`` a fresh one; None where there is no checkpoint.

    Raises:
      InvalidInput: the file is damaged, or belongs to another plan.
    """
    if not agreed(path.exists()):
        return None
    shapes = jax.eval_shape(
        lambda state: _in_order(state, lambda rows: rows[partition.places]), like
    )
    if first():
        if read_header(path, "checkpoint") != _describe(plan):
            raise InvalidInput(
                f"checkpoint {path}: belongs to another training; remove it, or choose another "
                "folder"
            )
        saved = read_leaves(path, shapes, "checkpoint")
    else:
        saved = jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), shapes)
    saved = agreed(saved)

    def scatter(node, rows):
        return partition.scatter(rows) if _owned(node) else rows

    return jax.tree.map(scatter, like, saved, is_leaf=_owned)


def _in_order(state, of):
    """The state with ``of`` the rows in place of what is owned."""
    return jax.tree.map(
        lambda node: jax.tree.map(of, node.rows) if _owned(node) else node, state, is_leaf=_owned
    )


def _owned(node):
    return isinstance(node, Sharded)


def _describe(plan):
    return {**dataclasses.asdict(plan), "scene": plan.scene.record}
