"""A surrogate as one web page: sliders for the body and the Reynolds number, loads at once.

The page works offline and without libraries: it contains the network's weights, and JavaScript that
evaluates the network and draws the body.
"""

import html
import json
import math
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from string import Template

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.family import Family
from surrogate.body.parameters import PARAMETERS, Kind
from surrogate.body.validity import CLEAR_THICKNESS_RATIO, MIN_THICKNESS_RATIO
from surrogate.exports.plain import plain_network
from surrogate.files import JsonObject, whole_file
from surrogate.model.surrogate import Surrogate
from surrogate.scene.stream import describe_stream

MINUS = "\N{MINUS SIGN}"
SCRIPTS = {
    "model": ("network.js", "family.js", "model.js"),
    "view": ("drawing.js", "curves.js", "view.js"),
}
NUMBERS = (  # of the plain network that network.js evaluates
    *("logs", "scale", "shift", "incidence", "angle", "sources", "waves", "mirror"),
    *("inertial", "stokes", "constant", "linear", "quadratic", "weights", "biases"),
)
START = 1.6  # aspect of the body shown first, over the reference body's
START_INCIDENCE = 4.0  # degrees, of the body shown first
ROOM_FOR_LIFT = 1.7  # least height in D of the frame of bodies with lift
TALLEST = 1.4  # greatest height that the frame fits, over the ellipse's of the least aspect


def write_page(surrogate: Surrogate, path: str | Path) -> Path:
    """Write the page to a file and return its path."""
    with whole_file(path) as part:
        part.write_text(page(surrogate), encoding="utf-8")
    return Path(path)


def page(surrogate: Surrogate) -> str:
    """Return the page as HTML text."""
    scene, name = surrogate.scene, reference_name(surrogate.scene.family)
    lifting = scene.family.has_lift
    return Template(_text("page.html")).substitute(
        {part: "\n".join(map(_text, files)) for part, files in SCRIPTS.items()},
        style=_text("style.css"),
        **_frame(scene.family),
        title="Drag and lift" if lifting else "Drag",
        kind="has-lift" if lifting else "no-lift",
        force=" and the force on it" if lifting else "",
        reference=name,
        measure="area" if scene.dimension == 2 else "volume",
        reference_button=name[0].upper() + name[1:],
        sliders="\n".join(_sliders(surrogate)),
        lead=html.escape(_lead(surrogate)),
        provenance=html.escape(_provenance(surrogate)),
        data=json.dumps(page_data(surrogate), allow_nan=False).replace("</", "<\\/"),
    )


def _text(name: str) -> str:
    """Return the text of one of the files that the page is made of."""
    return (resources.files(__package__) / name).read_text(encoding="utf-8")


def page_data(surrogate: Surrogate) -> JsonObject:
    """Return the weights, scales and bounds that the page's script needs, as a JSON object."""
    family, numbers = surrogate.scene.family, plain_network(surrogate).record()
    return {
        **{name: numbers[name] for name in NUMBERS},
        "names": list(family.names),
        "modes": list(family.body_class.modes),
        "camberModes": list(family.body_class.camber_modes),
        "ratios": len(family.body_class.indices(Kind.RATIO)),
        "dimension": family.dimension,
        "bounds": family.bounds.tolist(),
        "reynolds": list(surrogate.scene.reynolds),
        "reference": reference_body(family).tolist(),
        "leastThicknessRatio": MIN_THICKNESS_RATIO,
        "clearThicknessRatio": CLEAR_THICKNESS_RATIO,
    }


def reference_body(family: Family) -> Float[AnyArray, " parameters"]:
    """Return the body that drags are compared with: the family's nearest to a cylinder (sphere)."""
    return np.clip(family.ellipse(1.0), *family.bounds.T)


def reference_name(family: Family) -> str:
    """Return the name of the reference body for the page's text."""
    body, turned = reference_body(family), family.body_class.indices(Kind.INCIDENCE)
    aspect = float(family.body_class.aspect(body))
    ellipse = family.ellipse(aspect)
    ellipse[turned] = body[turned]
    if np.any(body != ellipse):
        return "roundest body"
    if aspect == 1:  # at any incidence
        return family.round_body
    name = f"{aspect:g}:1 {'ellipse' if family.dimension == 2 else 'spheroid'}"
    return name + "".join(f" at {degrees:g}\N{DEGREE SIGN}" for degrees in body[turned] if degrees)


def _frame(family: Family) -> dict[str, str]:
    """Return SVG attributes: the view box, and three arrows of the stream at its left as a path."""
    length, height = family.extent[0], max(family.extent[1:])
    least = float(family.body_class.aspect(family.bounds.T)[0])
    if family.has_lift:
        height = max(height, ROOM_FOR_LIFT)
    else:
        height = min(height, TALLEST / math.sqrt(least))  # taller ones mostly cross
    left, top = -length / 2 - 0.55, -height / 2 - 0.12
    dart = "h.3m-.08 -.05l.08 .05l-.08 .05"
    return {
        "frame": f"{left:.3f} {top:.3f} {length + 0.7:.3f} {-2 * top:.3f}",
        "arrow": "".join(f"M{left + 0.06:.3f} {y}{dart}" for y in (-0.4, 0, 0.4)),
    }


def _lead(surrogate: Surrogate) -> str:
    """Return the page's first lines: measured errors, and the reference body if it is unusual."""
    recorded, name = surrogate.recorded, reference_name(surrogate.scene.family)
    text = (
        "Every number comes from a trained network that runs in this page: the drag is "
        f"{100 * recorded('drag_error_mean'):.2f} % off on average, "
        f"{100 * recorded('drag_error_max'):.2f} % at worst, on {surrogate.unseen} unseen "
        "bodies."
    )
    if "moment_error_max" in surrogate.record:
        lift, moment = (
            f"{100 * recorded(f'{load}_error_mean'):.2f} % of the drag "
            f"({100 * recorded(f'{load}_error_max'):.2f} % at worst)"
            for load in ("lift", "moment")
        )
        text += f" Lift is off by {lift}, the moment by {moment}, so that small ones are off by"
        text += " more of themselves."
    if name != (usual := surrogate.scene.family.round_body):
        text += f" Its family has no {usual}: bodies are compared with the {name}."
    return text


def _provenance(surrogate: Surrogate) -> str:
    """Return the page's last lines: definitions, method and trained ranges."""
    scene = surrogate.scene
    ranges = ", ".join(
        f"{name} {_number(low)} to {_number(high)}"
        for name, (low, high) in (("Re", scene.reynolds), *scene.family.ranges)
    )
    square = "\N{SUPERSCRIPT TWO}"
    rho = f"\N{GREEK SMALL LETTER RHO}U{square}"
    over = f"drag per unit span over {rho}D / 2, D the diameter of the cylinder of the same area"
    reference = f"D{square} / 2"
    if scene.dimension == 3:
        area = f"\N{GREEK SMALL LETTER PI}D{square} / 8"
        over = f"drag over {rho}{area}, D the diameter of the sphere of the same volume"
        reference = "\N{GREEK SMALL LETTER PI}D\N{SUPERSCRIPT THREE} / 8"
    if scene.family.has_lift:
        over += f"; lift likewise; moment about the centroid, nose up, over {rho}{reference}"
    return (
        f"Steady laminar flow in {describe_stream(scene.stream)}; {over}, "
        "Re = U D / \N{GREEK SMALL LETTER NU}. Trained by the method "
        f"{surrogate.recorded('method')} on {ranges}; the sliders end there. Errors are relative "
        "to the flow solver."
    )


def _sliders(surrogate: Surrogate) -> Iterator[str]:
    """Yield sliders for log Re and for every shape parameter, set to an ellipse, nose up."""
    family = surrogate.scene.family
    low, high = (math.log(value) for value in surrogate.scene.reynolds)
    yield _slider("reynolds", "Reynolds number", low, high, (low + high) / 2, log=True)
    aspect = START * float(family.body_class.aspect(reference_body(family)))
    turned = [START_INCIDENCE * (p.kind is Kind.INCIDENCE) for p in family.body_class.parameters]
    start = np.clip(family.ellipse(aspect) + turned, *family.bounds.T)
    for (name, (low, high)), value in zip(family.ranges, start, strict=True):
        yield _slider(name, PARAMETERS[name].label, low, high, value)


def _slider(name: str, label: str, low: float, high: float, start: float, log: bool = False) -> str:
    shown = math.exp if log else float
    keypad = ' inputmode="decimal"' * (shown(low) >= 0)  # that of phones may lack a minus sign
    return (
        f'<div class="slider"><label for="{name}">{label}</label>'
        f'<small id="{name}-way" class="way"></small>'
        f'<input type="text" class="value" id="{name}-value"{keypad} '
        f'autocomplete="off" aria-label="{label}, value">'
        f'<small>{_number(shown(low))}</small><input type="range" id="{name}" autocomplete="off" '
        f'min="{float(low)!r}" max="{float(high)!r}" step="any" value="{float(start)!r}">'
        f"<small>{_number(shown(high))}</small></div>"
    )


def _number(value: float) -> str:
    return f"{value:.4g}".replace("-", MINUS)
