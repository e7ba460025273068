"""Checkpoints: an interrupted training resumes with the same result as one that ran through."""

import dataclasses
import time
from pathlib import Path

import jax
import numpy as np
from jaxtyping import PyTree

from surrogate.devices import is_sharded
from surrogate.errors import InvalidInput
from surrogate.leaves import leaves_digest, read_header, read_leaves, write_leaves
from surrogate.partition import Partition
from surrogate.processes import broadcast_from_first, broadcast_json, first, gather_to_host
from surrogate.repeats import differences
from surrogate.training.plan import Plan

DIGEST = "sha256"  # of the arrays, in the header
SHARE = 0.1  # of the time of a training, about, that may go into writing checkpoints


class Checkpoints:
    """Writer and reader of the checkpoints of one training.

    Args:
      path: of the file; None for no checkpoints.
      plan: of the training.
      partition: of its samples over devices.
      every_s: least seconds between two checkpoints. Large ones are written less often, so that
        they take a tenth of the time.
    """

    def __init__(self, path: Path | None, plan: Plan, partition: Partition, every_s: float):
        self.path, self.plan, self.partition, self.every_s = path, plan, partition, every_s
        self.next = time.perf_counter() + every_s

    def load(self, like: PyTree) -> PyTree | None:
        """Return the saved state, in the structure of ``like``; None if there is none."""
        return self.path and load_checkpoint(self.path, self.plan, like, self.partition)

    def save_if_due(self, state: PyTree) -> None:
        """Write the state if the last checkpoint is old enough."""
        start = time.perf_counter()
        if self.path and broadcast_from_first(start >= self.next):
            save_checkpoint(self.path, self.plan, state, self.partition)
            end = time.perf_counter()
            self.next = end + max(self.every_s, (end - start) / SHARE if self.every_s else 0.0)


def save_checkpoint(path: Path, plan: Plan, state: PyTree, partition: Partition) -> None:
    """Write the plan and all leaves of ``state`` to one file, atomically.

    Sharded arrays are written in the order of the samples, so that a training may resume on
    another number of devices. In a multi-process run the first process writes.

    Args:
      path: of the file.
      plan: of the training; stored, so that only the same training resumes from the file.
      state: pytree of arrays, with ``Sharded`` nodes of one row per sample.
      partition: of the samples over devices.
    """
    places = np.asarray(partition.places)
    state = _map_sharded(state, lambda rows: gather_to_host(rows)[places])
    if first():
        write_leaves(path, state, _describe(plan) | {DIGEST: leaves_digest(state)})


def load_checkpoint(path: Path, plan: Plan, like: PyTree, partition: Partition) -> PyTree | None:
    """Return the saved state, in the structure of ``like``; None if there is no checkpoint.

    Args:
      path: of the file.
      plan: of the training that is to resume.
      like: a state with the same structure, shapes and types.
      partition: of the samples over devices, by which ``Sharded`` nodes are split anew.

    Raises:
      InvalidInput: the file is damaged, or belongs to another plan.
    """
    if not broadcast_from_first(path.exists()):
        return None
    shapes = jax.eval_shape(
        lambda state: _map_sharded(state, lambda rows: rows[partition.places]), like
    )
    saved, problem = jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), shapes), None
    if first():
        try:
            saved = _read(path, plan, shapes)
        except InvalidInput as error:
            problem = str(error)
    if problem := broadcast_json(problem):  # else the other processes would wait
        raise InvalidInput(problem)
    saved = broadcast_from_first(saved)

    def scatter(node, rows):
        return partition.scatter(rows) if is_sharded(node) else rows

    return jax.tree.map(scatter, like, saved, is_leaf=is_sharded)


def _read(path, plan, shapes):
    """Return the saved state of a checkpoint, checked."""
    if found := checkpoint_differences(path, plan):
        raise InvalidInput(f"checkpoint {path}: belongs to another training ({found})")
    saved = read_leaves(path, shapes, "checkpoint", "; remove it")
    if leaves_digest(saved) != read_header(path).get(DIGEST):
        raise InvalidInput(f"checkpoint {path}: damaged, not what was saved; remove it")
    return saved


def checkpoint_differences(path: Path, plan: Plan) -> str:
    """Return in words how the plan of a checkpoint differs from this one; "" if it does not.

    Raises:
      InvalidInput: the file is damaged, or no checkpoint.
    """
    header = read_header(path)
    known = _describe(plan)
    if not isinstance(header, dict) or set(header) - {DIGEST} != set(known):
        raise InvalidInput(f"checkpoint {path}: damaged, or of another program; remove it")
    return differences({name: header[name] for name in known}, known)


def _map_sharded(state, function):
    """Return the state with ``function(rows)`` in place of sharded arrays."""
    return jax.tree.map(
        lambda node: jax.tree.map(function, node.rows) if is_sharded(node) else node,
        state,
        is_leaf=is_sharded,
    )


def _describe(plan):
    return dataclasses.asdict(plan) | {"scene": plan.scene.record, "infill": list(plan.infill)}
