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
NO_SURROGATE, UNNAMED = "none", "unnamed"  # in place of a surrogate's name
KINDS = {"cases": list, "surrogate": str, "until": str, "about_lift": bool}  # of entries
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
        record = strict_json((folder / RECORD).read_text(encoding="utf-8"))
        scene = Scene.of(record["scene"])
        scene.family.check(scene.family.parameters(record["parameters"]))
        scene.family.check_all(np.array(record["path"]))
        check_reynolds(record["reynolds"], scene.dimension)
        finite_number("Reynolds number", run_reynolds(record))
        drags = [record[name] for name in DRAGS if record[name] is not None]
        sound = all(finite_number("drag", drag) > 0 for drag in drags) and record["path"]
        of_objective = (record["objective"][name] for name in ("kind", "number_of_cases"))
        values = *(record[name] for name in KINDS), *of_objective
        kinds = *KINDS.values(), str, int
        if not (sound and all(map(isinstance, values, kinds))):
            raise ValueError
        return record
    except OSError:
        raise InvalidInput(f"run {folder}: no {RECORD} there; a run has one") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InvalidInput(
            f"run {folder}: {RECORD} is damaged, or of another program or version; overwrite "
            "(--overwrite) replaces it"
        ) from None


def run_scene(record: dict[str, Any]) -> Scene:
    """Return the scene of a run."""
    return Scene.of(record["scene"])


def run_body(record: dict[str, Any]) -> np.ndarray:
    """Return the parameters of the body that a run found."""
    return run_scene(record).family.parameters(record["parameters"])


def surrogate_name(record: dict[str, Any]) -> str | None:
    """Return the name by which a run's surrogate can be loaded; None where it has none."""
    return None if record["surrogate"] in (NO_SURROGATE, UNNAMED) else record["surrogate"]


def is_by_chord(record: dict[str, Any]) -> bool:
    """Return whether the coefficients of a run, and its Reynolds number, are by the chord."""
    return record["reference"] == CHORD


def run_reference(record: dict[str, Any]) -> Reference:
    """Return the reference length of a run's coefficients."""
    return Reference(run_scene(record).family.body_class, is_by_chord(record))


def run_reynolds(record: dict[str, Any]) -> float:
    """Return the Reynolds number of a run by its reference length."""
    return record["chord_reynolds" if is_by_chord(record) else "reynolds"]


def reynolds_text(record: dict[str, Any]) -> str:
    """Return the Reynolds number of a run as words."""
    return f"{'chord ' * is_by_chord(record)}Re {run_reynolds(record):.4g}"
