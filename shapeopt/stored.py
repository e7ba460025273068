"""Designs that are stored already: the same one is not repeated, another one is not replaced."""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from shapeopt.problem.problem import NO_CONSTRAINTS, Problem
from shapeopt.records import RECORD, is_whole, load_run
from shapeopt.runs import check_run_folder
from surrogate.files import JsonObject, path_of, target_of
from surrogate.model.surrogate import Surrogate
from surrogate.repeats import check_settings


def design_settings(
    problem: Problem, surrogate: Surrogate | None, on_flow: bool, memory: str | None = None
) -> JsonObject:
    """Return the settings that define a design, as plain values for JSON.

    Args:
      problem: objective and constraints.
      surrogate: the model, known by its weights; None for the flow.
      on_flow: whether the search ends at the flow's optimum, else at the surrogate's.
      memory: file of the flows that are kept from design to design.
    """
    given = surrogate and (surrogate.record.get("method"), surrogate.record.get("weights_sha256"))
    constraints = (f.name for f in dataclasses.fields(problem) if f.name not in NO_CONSTRAINTS)
    settings = {
        **problem.scene.record,
        "by_chord": problem.by_chord,
        "objective": _plain(problem.objective),
        **{name: _plain(getattr(problem, name)) for name in constraints},
        "surrogate": given and f"{given[0]} {str(given[1])[:12]}",
        "until": "flow" if on_flow else "surrogate",
        "memory": memory and str(target_of(memory)),
    }
    return json.loads(json.dumps(settings))


def stored_run(folder: str | Path, settings: JsonObject, overwrite: bool) -> JsonObject | None:
    """Return the record of a folder's run if it is a design of these settings, else None.

    Args:
      folder: of the run.
      settings: from ``design_settings``.
      overwrite: return None whatever run is there.

    Raises:
      InvalidInput: it holds another design and ``overwrite`` is not set, or something else.
    """
    check_run_folder(folder)
    folder = path_of(folder)
    if overwrite or not (folder / RECORD).is_file():
        return None
    record = load_run(folder)
    check_settings(folder, "design", record.get("settings"), settings)
    return record | {"contour": str(folder / "contour.csv")} if is_whole(folder, record) else None


def _plain(value: object) -> object:
    """Return an objective or a constraint as values that JSON has."""
    if dataclasses.is_dataclass(value):
        fields = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"kind": type(value).__name__, **fields}
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(part) for part in value]
    return float(value) if isinstance(value, np.number) else value
