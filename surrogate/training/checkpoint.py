"""An interrupted training: everything needed to go on as if nothing had happened."""

import dataclasses
from pathlib import Path

from jaxtyping import PyTree

from surrogate.errors import InvalidInput
from surrogate.leaves import read_header, read_leaves, write_leaves
from surrogate.training.plan import Plan


def save_checkpoint(path: Path, plan: Plan, state: PyTree) -> None:
    """Write the plan and all leaves of ``state`` in one file, whole or not at all."""
    write_leaves(path, state, _describe(plan))


def load_checkpoint(path: Path, plan: Plan, like: PyTree) -> PyTree | None:
    """The saved state, shaped ``like`` a fresh one; None where there is no checkpoint.

    Raises:
      InvalidInput: the file is damaged, or belongs to another plan.
    """
    if not path.exists():
        return None
    if read_header(path, "checkpoint") != _describe(plan):
        raise InvalidInput(
            f"checkpoint {path}: belongs to another training; remove it, or choose another folder"
        )
    return read_leaves(path, like, "checkpoint")


def _describe(plan):
    return {**dataclasses.asdict(plan), "scene": plan.scene.record}
