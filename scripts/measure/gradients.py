"""How right shape gradients are: of the adjoint on each grid, and of the surrogates that ship.

python scripts/measure_gradients.py --out out/gradients
"""

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from common import Parser, emit, markdown, progress_bar, run

from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import check_folder, whole_file
from surrogate.flow.flow import family_drag_and_shape_gradient
from surrogate.scene.scene import FIDELITIES, Scene
from surrogate.model.store import load_surrogate
from surrogate.training.physics import Samples, draw_samples, scene_domain
from surrogate.training.presets import METHODS

LEVELS = ("draft", "standard", "fine")


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Gradients of unseen bodies by every grid and surrogate, against standard and fine."""
    arguments = _parser().parse_args(argv)
    if not 4 <= arguments.bodies <= 1000:
        raise InvalidInput(f"--bodies {arguments.bodies}: from 4 to 1000")
    check_folder(arguments.out)
    scene = Scene()
    unseen = jax.random.split(jax.random.key(0), 3)[1]
    bodies = draw_samples(scene, unseen, arguments.bodies)
    found = {}
    with progress_bar("shape gradients") as progress:
        for k, level in enumerate(LEVELS):
            progress(k / len(LEVELS), f"adjoint, {level}")
            grid = dataclasses.replace(scene, fidelity=FIDELITIES[level])
            found[f"adjoint, {level}"] = _by_adjoint(grid, bodies)
        progress(1.0)
    for method in METHODS:
        network = load_surrogate(f"pretrained:{method}").network
        found[method] = np.asarray(jax.vmap(jax.grad(network.drag))(*bodies))
    widths = np.ptp(scene.family.bounds, axis=1)
    rows = [
        {
            "gradient": name,
            "from_standard": _distance(gradient, found["adjoint, standard"], widths),
            "from_fine": _distance(gradient, found["adjoint, fine"], widths),
        }
        for name, gradient in found.items()
    ]
    with whole_file(Path(arguments.out) / "gradients.json") as part:
        part.write_text(json.dumps(rows, indent=1) + "\n")
    heads = ["gradient of", "from the standard adjoint", "from the fine adjoint"]
    lines = [
        [r["gradient"], *(f"{100 * r[key]:.1f} %" for key in ("from_standard", "from_fine"))]
        for r in rows
    ]
    return emit({"rows": rows}, arguments.json, markdown(heads, lines))


def _by_adjoint(scene: Scene, bodies: Samples) -> np.ndarray:
    domain, slopes = scene_domain(scene), []
    for body, reynolds in zip(*bodies, strict=True):
        _, slope, info = family_drag_and_shape_gradient(domain, body, reynolds)
        if not (bool(info.converged) and np.all(np.isfinite(slope))):
            raise NotConverged(f"adjoint at Re {float(reynolds):g} did not converge")
        slopes.append(np.asarray(slope))
    return np.array(slopes)


def _distance(gradient: np.ndarray, truth: np.ndarray, widths: np.ndarray) -> float:
    """Median over the bodies of |g - truth| / |truth|, in ranges of the parameters."""
    miss = np.linalg.norm((gradient - truth) * widths, axis=1)
    return float(np.median(miss / np.linalg.norm(truth * widths, axis=1)))


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, default=64, help="unseen bodies")
    parser.add_argument("--out", required=True, help="folder of gradients.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
