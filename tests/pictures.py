"""What tests of pictures share: a body, a run's record, and a look at a picture."""

from pathlib import Path
from typing import Any

import numpy as np

from surrogate import Scene
from surrogate.flow.output.meshes import pv

LENS = np.array([2.0, 0.1, -0.05, 0.0])


def record_of(scene: Scene, reynolds: float = 20.0, parameters=LENS) -> dict[str, Any]:
    """The record of a run that found ``parameters``."""
    return {
        "parameters": scene.family.named(parameters),
        "reynolds": reynolds,
        "cd_start": 2.2,
        "cd_verified": 2.2 - reynolds / 100,
        "surrogate": "none",
        "until": "flow",
        "reference": "diameter",
        "objective": {"kind": "AtReynolds", "number_of_cases": 1},
        "about_lift": False,
        "cases": [],
        "cd_surrogate": None,
        "scene": scene.record,
        "path": [parameters.tolist()],
    }


def pixels(path: Path) -> tuple[tuple[int, int], np.ndarray]:
    """Size and colours of a picture that is not blank."""
    picture = pv.read(path)
    width, height, _ = picture.dimensions
    colours = np.asarray(picture.active_scalars)[:, :3]
    assert len(np.unique(colours @ (1, 256, 256**2))) > 50, "blank"
    assert colours.std() > 10, "blank"
    return (width, height), colours
