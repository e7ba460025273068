"""One web page that holds a surrogate: sliders for body and Reynolds number, drag at once.

The page needs no network and no library; its weights and its arithmetic are inside it.
"""

import html
import json
import math
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from shapeopt.search.verify import CYLINDER
from surrogate.body.family import LEAST_OPENING, PARAMETERS
from surrogate.errors import InvalidInput
from surrogate.files import whole_file
from surrogate.scene.scene import Unbounded
from surrogate.model.store import Surrogate

MINUS = "\N{MINUS SIGN}"
LABELS = {
    "aspect": "Aspect, length to thickness",
    "beta2": "Fuller fore or aft, \N{GREEK SMALL LETTER BETA}2",
    "beta3": "Blunt or pointed ends, \N{GREEK SMALL LETTER BETA}3",
    "beta4": "Finer fore and aft, \N{GREEK SMALL LETTER BETA}4",
}


def write_page(surrogate: Surrogate, path: str | Path) -> Path:
    """Write the page, whole or not at all."""
    with whole_file(path) as part:
        part.write_text(page(surrogate), encoding="utf-8")
    return Path(path)


def page(surrogate: Surrogate) -> str:
    """The page as text."""
    files = resources.files("shapeopt") / "page"
    length, height = surrogate.scene.family.extent
    left, top = -length / 2 - 0.55, -height / 2 - 0.12
    middle = left + 0.06
    return Template((files / "page.html").read_text(encoding="utf-8")).substitute(
        style=(files / "style.css").read_text(encoding="utf-8"),
        model=(files / "model.js").read_text(encoding="utf-8"),
        view_script=(files / "view.js").read_text(encoding="utf-8"),
        view=f"{left:.3f} {top:.3f} {length + 0.7:.3f} {-2 * top:.3f}",
        arrow="".join(f"M{middle:.3f} {y}h.3m-.08 -.05l.08 .05l-.08 .05" for y in (-0.4, 0.0, 0.4)),
        sliders="\n".join(_sliders(surrogate)),
        lead=html.escape(_lead(surrogate)),
        provenance=html.escape(_provenance(surrogate)),
        data=json.dumps(page_data(surrogate), allow_nan=False).replace("</", "<\\/"),
    )


def page_data(surrogate: Surrogate) -> dict[str, Any]:
    """What the page's arithmetic needs: weights, scales, bounds; every number as it is here.

    Raises:
      InvalidInput: the surrogate was not trained on the cylinder, which the page compares with.
    """
    network, bounds = surrogate.network, surrogate.scene.family.bounds
    if not surrogate.scene.family.contains(CYLINDER):
        raise InvalidInput("explore: the surrogate's family must hold the cylinder, its reference")
    return {
        "layers": [
            {"weight": np.asarray(layer.weight).tolist(), "bias": np.asarray(layer.bias).tolist()}
            for layer in network.layers
        ],
        **{
            name: np.asarray(getattr(network, name)).tolist()
            for name in ("low", "high", "size", "mean", "spread")
        },
        "names": list(PARAMETERS),
        "bounds": bounds.tolist(),
        "reynolds": list(surrogate.scene.reynolds),
        "leastOpening": LEAST_OPENING,
    }


def _lead(surrogate):
    """How right the numbers are, as it was measured."""
    recorded = surrogate.recorded
    return (
        "Every number comes from a trained network that runs in this page: "
        f"{100 * recorded('drag_error_mean'):.2f} % off on average, "
        f"{100 * recorded('drag_error_max'):.2f} % at worst, on {recorded('held_out')} unseen "
        "bodies."
    )


def _provenance(surrogate):
    """What the surrogate knows."""
    scene = surrogate.scene
    low, high = scene.reynolds
    bounds = ", ".join(
        f"{name} {a:g} to {b:g}".replace("-", MINUS)
        for name, (a, b) in zip(PARAMETERS, scene.family.bounds, strict=True)
    )
    stream = "an unbounded stream"
    if scene.stream != Unbounded():
        stream = f"a slip-walled tunnel of height {scene.stream.height:g} D"
    return (
        f"Steady laminar flow in {stream}; drag per unit span over \N{GREEK SMALL LETTER RHO}"
        "U\N{SUPERSCRIPT TWO}D / 2, D the diameter of the cylinder of the same area, Re = U D / "
        f"\N{GREEK SMALL LETTER NU}. Trained by the method {surrogate.recorded('method')} on Re "
        f"{low:g} to {high:g}, {bounds}; the sliders end there. Errors are against the flow solver."
    )


def _sliders(surrogate):
    """Reynolds number by its logarithm, then every shape parameter, from an ellipse."""
    low, high = (math.log(value) for value in surrogate.scene.reynolds)
    yield _slider("reynolds", "Reynolds number", low, high, (low + high) / 2, "")
    for name, (low, high) in zip(PARAMETERS, surrogate.scene.family.bounds, strict=True):
        start = min(max(1.6 if name == "aspect" else 0.0, low), high)
        yield _slider(name, LABELS[name], low, high, start, f'<small id="{name}-way"></small>')


def _slider(name, label, low, high, start, way):
    way = way.replace("<small", '<small class="way"')
    return (
        f'<div class="slider"><label for="{name}">{label}</label>'
        f'<output id="{name}-value" for="{name}"></output>'
        f'<input type="range" id="{name}" min="{float(low)!r}" max="{float(high)!r}" '
        f'step="any" value="{float(start)!r}">'
        f"<small>{_end(name, low)} to {_end(name, high)}</small>{way}</div>"
    )


def _end(name, value):
    number = math.exp(value) if name == "reynolds" else value
    return f"{number:.3g}".replace("-", MINUS)
