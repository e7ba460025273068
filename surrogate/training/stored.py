"""Trainings that are stored already: the same one is not repeated, another one is not replaced."""

import contextlib
import dataclasses
from pathlib import Path

import jax

from surrogate.errors import InvalidInput
from surrogate.files import path_of, target_of
from surrogate.model.network import blank_network
from surrogate.model.store import RECORD, check_surrogate_folder, read_record, read_surrogate
from surrogate.model.surrogate import Surrogate
from surrogate.processes import broadcast_from_first, broadcast_json, first
from surrogate.repeats import refusal
from surrogate.training.checkpoint import checkpoint_differences
from surrogate.training.plan import Plan
from surrogate.training.record import plan_differences


def stored_training(plan: Plan, folder: str | Path, overwrite: bool) -> Surrogate | None:
    """Return the surrogate that a folder holds if this plan's training is done there, else None.

    Its errors may have been measured on another number of held-out bodies than the plan's. In a
    multi-process run the first process reads the files.

    Args:
      plan: the training that is asked for.
      folder: of the surrogate; a checkpoint may lie beside it.
      overwrite: accept that the folder, or the checkpoint, is of another training.

    Raises:
      InvalidInput: another training is stored there and ``overwrite`` is not set, or something
        that is no training.
    """
    found, problem = None, None
    if first():
        try:
            found = _read(plan, path_of(folder), overwrite)
        except InvalidInput as error:
            problem = str(error)
    problem, record = broadcast_json([problem, found and found.record])
    if problem is not None:
        raise InvalidInput(problem)
    if record is None:
        return None
    hidden = tuple(record["sizes"][:-1])
    network = found.network if found else blank_network(plan.scene, hidden, jax.random.key(0))
    return Surrogate(broadcast_from_first(network), plan.scene, record)


def checkpoint_path(folder: str | Path) -> Path:
    """Return the path of a training's checkpoint, beside the surrogate's folder."""
    place = target_of(folder)
    return place.with_name(place.name + ".checkpoint")


def _read(plan, folder, overwrite):
    folder = target_of(folder)
    check_surrogate_folder(folder)
    found = _finished(plan, folder, overwrite)
    checkpoint = checkpoint_path(folder)
    if not checkpoint.is_file():
        return found
    if found is not None and not overwrite:
        with contextlib.suppress(InvalidInput):  # of another training: stays
            if not checkpoint_differences(checkpoint, plan):
                checkpoint.unlink()  # the process was killed after saving
    elif different := checkpoint_differences(checkpoint, plan):
        if not overwrite:
            raise InvalidInput(refusal(checkpoint, "training, interrupted", different))
        checkpoint.unlink()
    return found


def _finished(plan, folder, overwrite):
    """Return the surrogate in the folder, if it is of this plan and whole."""
    if not (folder / RECORD).is_file():
        return None
    try:
        record = read_record(folder)
        measured = dataclasses.replace(plan, held_out=record.get("held_out"))
        different = plan_differences(measured, record)
    except InvalidInput as problem:  # damaged, or of another version
        different = str(problem)
    if different and not overwrite:
        raise InvalidInput(refusal(folder, "training", different))
    with contextlib.suppress(InvalidInput):  # the process was killed between its files
        return None if different else read_surrogate(folder)
    return None
