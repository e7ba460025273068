"""A shape optimisation's folder: what was asked, what was found, the contour, the path."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from surrogate.arrays import AnyArray
from surrogate.body import PARAMETERS, family_markers
from surrogate.errors import InvalidInput
from surrogate.files import check_target, whole_folder

CONTOUR_POINTS = 400
RECORD = "run.json"


def save_run(folder: str | Path, record: dict[str, Any], parameters: AnyArray) -> None:
    """Write run.json and contour.csv, whole or not at all."""
    folder = Path(folder)
    check_target(folder, RECORD)
    with whole_folder(folder) as part:
        (part / RECORD).write_text(json.dumps(record, indent=1) + "\n")
        contour = np.asarray(family_markers(parameters, CONTOUR_POINTS))
        np.savetxt(part / "contour.csv", contour, "%.9f", ",", header="x,y", comments="")


def load_run(folder: str | Path) -> dict[str, Any]:
    """The record of a run.

    Raises:
      InvalidInput: the folder is missing, or holds no readable run.
    """
    folder = Path(folder)
    try:
        record = json.loads((folder / RECORD).read_text())
        [record["parameters"][name] for name in PARAMETERS]
        record["reynolds"], record["scene"], record["path"]
        return record
    except OSError:
        raise InvalidInput(
            f"run {folder}: no run.json there; optimize_shape.py makes one"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise InvalidInput(f"run {folder}: run.json is damaged or of another program") from None
