"""An interrupted training: everything needed to go on as if nothing had happened."""

import dataclasses
import json
import zipfile
from pathlib import Path

import jax
import numpy as np
from jaxtyping import PyTree

from surrogate.errors import InvalidInput
from surrogate.files import whole_file
from surrogate.training.presets import Plan


def save_checkpoint(path: Path, plan: Plan, state: PyTree) -> None:
    """Write the plan and all leaves of ``state`` in one file, whole or not at all."""
    leaves = {f"leaf{k}": np.asarray(leaf) for k, leaf in enumerate(jax.tree.leaves(state))}
    with whole_file(path) as part, part.open("wb") as file:
        np.savez(file, plan=np.array(_describe(plan)), **leaves)


def load_checkpoint(path: Path, plan: Plan, like: PyTree) -> PyTree | None:
    """The saved state, shaped ``like`` a fresh one; None where there is no checkpoint.

    Raises:
      InvalidInput: the file is damaged, or belongs to another plan.
    """
    if not path.exists():
        return None
    try:
        with np.load(path, allow_pickle=False) as saved:
            described = str(saved["plan"])
            leaves = [saved[f"leaf{k}"] for k in range(len(saved.files) - 1)]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        raise InvalidInput(f"checkpoint {path}: damaged; delete it to start again") from None
    fresh, structure = jax.tree.flatten(like)
    shapes = [np.shape(leaf) for leaf in fresh]
    if described != _describe(plan) or shapes != [leaf.shape for leaf in leaves]:
        raise InvalidInput(
            f"checkpoint {path}: belongs to another training; delete it or choose another --out"
        )
    return jax.tree.unflatten(structure, [jax.numpy.asarray(leaf) for leaf in leaves])


def _describe(plan):
    return json.dumps(dataclasses.asdict(plan), sort_keys=True)
