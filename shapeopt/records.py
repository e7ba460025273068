"""Records of runs, read from their folders: scene, body, and Reynolds number."""

from pathlib import Path
from typing import Any

import numpy as np

from shapeopt.problem.reference import Reference
from surrogate.body.chord_line import CHORD
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject, changed_files, path_of, strict_json
from surrogate.scene.limits import check_reynolds
from surrogate.scene.scene import Scene

RECORD = "run.json"
LONGEST_RECORD = 1 << 24  # bytes
DRAGS = ("cd_start", "cd_surrogate", "cd_verified")


def is_whole(folder: Path, record: JsonObject) -> bool:
    """Return whether the files of a run are those that were written with its record."""
    digests = record.get("files_sha256")
    return bool(digests) and not changed_files(folder, digests)


def load_run(folder: str | Path) -> dict[str, Any]:
    """Return the record of a run.

    Raises:
      InvalidInput: the folder is missing, or has no readable run.
    """
    folder = path_of(folder)
    try:
        if (folder / RECORD).stat().st_size > LONGEST_RECORD:
            raise ValueError
        record = strict_json((folder / RECORD).read_text(encoding="utf-8"))
        scene = Scene.of(record["scene"])
        scene.family.check(scene.family.parameters(record["parameters"]))
        scene.family.check_all(np.array(record["path"]))
        check_reynolds(record["reynolds"], scene.dimension)
        finite_number("Reynolds number", run_reynolds(record))
        drags = [record[name] for name in DRAGS if record.get(name) is not None]
        cases, name = record.get("cases", []), record["surrogate"]
        sound = all(finite_number("drag", drag) > 0 for drag in drags) and record["path"]
        if not (sound and isinstance(cases, list) and isinstance(name, str)):
            raise ValueError
        return record
    except OSError:
        raise InvalidInput(f"run {folder}: no {RECORD} there; a run has one") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InvalidInput(f"run {folder}: {RECORD} is damaged or of another program") from None


def run_scene(record: dict[str, Any]) -> Scene:
    """Return the scene of a run."""
    return Scene.of(record["scene"])


def run_body(record: dict[str, Any]) -> np.ndarray:
    """Return the parameters of the body that a run found."""
    return run_scene(record).family.parameters(record["parameters"])


def is_by_chord(record: dict[str, Any]) -> bool:
    """Return whether the coefficients of a run, and its Reynolds number, are by the chord."""
    return record.get("reference") == CHORD


def run_reference(record: dict[str, Any]) -> Reference:
    """Return the reference length of a run's coefficients."""
    return Reference(run_scene(record).family.body_class, is_by_chord(record))


def run_reynolds(record: dict[str, Any]) -> float:
    """Return the Reynolds number of a run by its reference length."""
    return record["chord_reynolds" if is_by_chord(record) else "reynolds"]


def reynolds_text(record: dict[str, Any]) -> str:
    """Return the Reynolds number of a run as words."""
    return f"{'chord ' * is_by_chord(record)}Re {run_reynolds(record):.4g}"
