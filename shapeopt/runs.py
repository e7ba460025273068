"""A shape optimisation's folder: what was asked, what was found, the body for other programs."""

import json
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from shapeopt.render.export import write_contour_csv, write_contour_vtp, write_solid_stl
from surrogate.flow.loads.surface import SURFACE_POINTS, solve_surface
from surrogate.arrays import AnyArray
from surrogate.body.family import PARAMETERS, family_markers
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import check_target, whole_folder
from surrogate.model.store import read_scene

RECORD = "run.json"


def save_run(folder: str | Path, record: dict[str, Any], parameters: AnyArray) -> None:
    """Write run.json, contour.csv, contour.vtp with the flow's loads, and body.stl.

    The folder is written whole or not at all.
    """
    folder = Path(folder)
    check_target(folder, RECORD)
    contour = family_markers(jnp.asarray(parameters), SURFACE_POINTS)
    surface = _loads(record, parameters)
    with whole_folder(folder) as part:
        (part / RECORD).write_text(json.dumps(record, indent=1) + "\n")
        write_contour_csv(contour, part / "contour.csv")
        write_contour_vtp(contour, part / "contour.vtp", surface)
        write_solid_stl(contour, part / "body.stl")


def _loads(record, parameters):
    """The body's surface loads at the run's Re; None where its flow is not to be had."""
    try:
        return solve_surface(read_scene(record["scene"]), parameters, record["reynolds"])
    except NotConverged:
        return None


def load_run(folder: str | Path) -> dict[str, Any]:
    """The record of a run.

    Raises:
      InvalidInput: the folder is missing, or holds no readable run.
    """
    folder = Path(folder)
    try:
        record = json.loads((folder / RECORD).read_text())
        read_scene(record["scene"]), str(record["surrogate"])
        body = [record["parameters"][name] for name in PARAMETERS]
        steps = np.array([*record["path"], [*body]], float)
        if np.all(np.isfinite(steps)) and record["reynolds"] > 0:
            return record
        raise ValueError
    except OSError:
        raise InvalidInput(
            f"run {folder}: no run.json there; optimize_shape.py makes one"
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InvalidInput(f"run {folder}: run.json is damaged or of another program") from None
