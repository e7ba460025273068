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
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.body_class import CLEAR_THICKNESS_RATIO, MIN_THICKNESS_RATIO
from surrogate.body.family import Family
from surrogate.body.parameters import PARAMETERS
from surrogate.errors import InvalidInput
from surrogate.files import check_file, whole_file
from surrogate.model.network import REACH
from surrogate.model.surrogate import Surrogate
from surrogate.scene.stream import describe_stream

GENERATOR, LOOKED_AT = b'content="drag-surrogates"', 1000  # by which a page is known as ours
MINUS = "\N{MINUS SIGN}"
START = 1.6  # aspect of the first body shown, over the reference's
TALLEST = 1.4  # that is drawn with room above, over an ellipse of the least aspect


def write_page(surrogate: Surrogate, path: str | Path) -> Path:
    """Write the page, whole or not at all."""
    with whole_file(path) as part:
        part.write_text(page(surrogate), encoding="utf-8")
    return Path(path)


def check_page(path: str | Path) -> Path:
    """The path of a page to be written.

    Raises:
      InvalidInput: it is no such path, or a page of another program is there.
    """
    path = check_file(path, ".html")
    if path.is_file() and GENERATOR not in path.read_bytes()[:LOOKED_AT]:
        raise InvalidInput(f"{path}: is of another program; choose another name")
    return path


def page(surrogate: Surrogate) -> str:
    """The page as text."""
    files = resources.files(__package__)
    parts = {
        part: (files / name).read_text(encoding="utf-8")
        for part, name in (("style", "style.css"), ("model", "model.js"), ("view", "view.js"))
    }
    name = reference_name(surrogate.scene.family)
    return Template((files / "page.html").read_text(encoding="utf-8")).substitute(
        parts,
        **_frame(surrogate.scene.family),
        reference=name,
        measure="area" if surrogate.scene.dimension == 2 else "volume",
        reference_button=name[0].upper() + name[1:],
        sliders="\n".join(_sliders(surrogate)),
        lead=html.escape(_lead(surrogate)),
        provenance=html.escape(_provenance(surrogate)),
        data=json.dumps(page_data(surrogate), allow_nan=False).replace("</", "<\\/"),
    )


def page_data(surrogate: Surrogate) -> dict[str, Any]:
    """What the page's arithmetic needs: weights, scales, bounds; every number as it is here."""
    network, family = surrogate.network, surrogate.scene.family
    return {
        "layers": [
            {"weight": np.asarray(layer.weight).tolist(), "bias": np.asarray(layer.bias).tolist()}
            for layer in network.layers
        ],
        "trend": np.asarray(network.trend).tolist(),
        "reach": REACH,
        "low": np.asarray(network.inputs.low).tolist(),
        "high": np.asarray(network.inputs.high).tolist(),
        "names": list(family.names),
        "modes": list(family.body_class.modes),
        "ratios": family.body_class.ratios,
        "dimension": family.dimension,
        "bounds": family.bounds.tolist(),
        "reynolds": list(surrogate.scene.reynolds),
        "reference": reference_body(family).tolist(),
        "leastOpening": MIN_THICKNESS_RATIO,
        "roomy": CLEAR_THICKNESS_RATIO,
    }


def reference_body(family: Family) -> Float[AnyArray, " parameters"]:
    """The body that all are compared with: cylinder or sphere, or the family's nearest to it."""
    return np.clip(family.ellipse(1.0), *family.bounds.T)


def reference_name(family: Family) -> str:
    """What the reference is, for a person."""
    body = reference_body(family)
    aspect = float(family.body_class.aspect(body))
    if np.any(body != family.ellipse(aspect)):
        return "roundest body"
    return family.round_body if aspect == 1 else f"{aspect:g}:1 ellipse"


def _frame(family):
    """The part of the plane that is drawn, and three arrows of the stream at its left."""
    length, height = family.extent[0], max(family.extent[1:])
    height = min(
        height, TALLEST / math.sqrt(family.body_class.aspect(family.bounds.T)[0])
    )  # most taller ones cross
    left, top = -length / 2 - 0.55, -height / 2 - 0.12
    dart = "h.3m-.08 -.05l.08 .05l-.08 .05"
    return {
        "frame": f"{left:.3f} {top:.3f} {length + 0.7:.3f} {-2 * top:.3f}",
        "arrow": "".join(f"M{left + 0.06:.3f} {y}{dart}" for y in (-0.4, 0, 0.4)),
    }


def _lead(surrogate):
    """How right the numbers are, as it was measured, and what they are compared with."""
    recorded, name = surrogate.recorded, reference_name(surrogate.scene.family)
    text = (
        "Every number comes from a trained network that runs in this page: "
        f"{100 * recorded('drag_error_mean'):.2f} % off on average, "
        f"{100 * recorded('drag_error_max'):.2f} % at worst, on {recorded('held_out')} unseen "
        "bodies."
    )
    if name != (usual := surrogate.scene.family.round_body):
        text += f" It knows no {usual}: its bodies are compared with the {name}."
    return text


def _provenance(surrogate):
    """What the surrogate knows."""
    scene = surrogate.scene
    ranges = ", ".join(
        f"{name} {_number(low)} to {_number(high)}"
        for name, (low, high) in (("Re", scene.reynolds), *scene.family.ranges)
    )
    rho = "\N{GREEK SMALL LETTER RHO}U\N{SUPERSCRIPT TWO}"
    over = f"drag per unit span over {rho}D / 2, D the diameter of the cylinder of the same area"
    if scene.dimension == 3:
        area = "\N{GREEK SMALL LETTER PI}D\N{SUPERSCRIPT TWO} / 8"
        over = f"drag over {rho}{area}, D the diameter of the sphere of the same volume"
    return (
        f"Steady laminar flow in {describe_stream(scene.stream)}; {over}, "
        "Re = U D / \N{GREEK SMALL LETTER NU}. TrainingResult by the method "
        f"{surrogate.recorded('method')} on {ranges}; the sliders end there. Errors are against "
        "the flow solver."
    )


def _sliders(surrogate):
    """Reynolds number by its logarithm, then every shape parameter, from an ellipse."""
    family = surrogate.scene.family
    low, high = (math.log(value) for value in surrogate.scene.reynolds)
    yield _slider("reynolds", "Reynolds number", low, high, (low + high) / 2, math.exp)
    start = np.clip(
        family.ellipse(START * float(family.body_class.aspect(reference_body(family)))),
        *family.bounds.T,
    )
    for (name, (low, high)), value in zip(family.ranges, start, strict=True):
        yield _slider(name, PARAMETERS[name].label, low, high, value)


def _slider(name, label, low, high, start, shown=float):
    return (
        f'<div class="slider"><label for="{name}">{label}</label>'
        f'<small id="{name}-way" class="way"></small>'
        f'<output id="{name}-value" for="{name}"></output>'
        f'<small>{_number(shown(low))}</small><input type="range" id="{name}" '
        f'min="{float(low)!r}" max="{float(high)!r}" step="any" value="{float(start)!r}">'
        f"<small>{_number(shown(high))}</small></div>"
    )


def _number(value):
    return f"{value:.4g}".replace("-", MINUS)
