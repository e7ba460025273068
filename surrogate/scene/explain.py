"""A scene in words, before long work: what is modelled, what is left out, what it will cost."""

import math
from typing import NamedTuple

from surrogate.body.family import Family
from surrogate.progress import duration
from surrogate.scene.cost import CONVOLUTIONS, seconds_per_convolution
from surrogate.scene.fidelity import NAMED, Fidelity, check_cells
from surrogate.scene.limits import ONSET_OF_INSTABILITY
from surrogate.scene.stream import Stream, describe_stream, domain_height


class Words(NamedTuple):
    """Parts of the text of ``Scene.explain`` that differ between 2-D and 3-D.

    Attributes:
      part: the part of the domain that is gridded.
      without_mirror: the same for bodies with camber or incidence; "" for all of it.
      tested: the tested ranges.
      tested_with_lift: those of bodies with camber or incidence.
      left_out: what is left out.
      unsteady: what instability does to the round body.
      others: when it happens to other bodies.
    """

    part: str
    without_mirror: str
    tested: str
    tested_with_lift: str
    left_out: str
    unsteady: str
    others: str


WORDS = {
    2: Words(
        "upper half",
        "",
        "Re 0.5 to 45 and aspect 0.5 to 5; longer wakes get a longer domain",
        "Re 1 to 200, aspect 1.5 to 6 and incidence -4 to 15",
        "the third dimension, ",
        "sheds vortices",
        "slender bodies do later, those wider than long sooner",
    ),
    3: Words(
        "quarter",
        "half",
        "Re 0.1 to 100 and aspect 0.5 to 4",
        "Re 1 to 100, aspect 0.5 to 3 and incidence 20 to 90",
        "",
        "is unstable",
        "bodies wider than long sooner",
    ),
}


def explain_scene(
    stream: Stream,
    reynolds: tuple[float, float],
    family: Family,
    fidelity: Fidelity,
    f: Fidelity,
    bodies: int,
) -> str:
    """Return the text of ``Scene.explain``.

    Args:
      stream: in which the bodies are.
      reynolds: least and greatest U D / nu.
      family: of the bodies.
      fidelity: of the scene.
      f: the same with its longest domain and its smallest cells.
      bodies: number of bodies of a training.

    Raises:
      InvalidInput: the grid has more cells than memory is likely to hold.
    """
    dimension, words = family.dimension, WORDS[family.dimension]
    symmetric, height = family.body_class.symmetric, domain_height(stream, f.height)
    rows = round(height * f.cells / 2)
    last = rows if symmetric else 2 * rows
    shape = round((f.upstream + f.downstream) * f.cells), *(rows,) * (dimension - 2), last
    check_cells(f, shape, symmetric)
    cells = math.prod(shape)
    part = words.part if symmetric else words.without_mirror
    seconds = seconds_per_convolution(shape, symmetric)
    sides = f"{f.upstream + f.downstream:g}" + f" x {height:g}" * (dimension - 1)
    ranges = ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in family.ranges)
    takes = CONVOLUTIONS[dimension, symmetric]

    aim = f"The tolerance of its drags is {100 * f.tolerance:g} %"
    if NAMED[dimension].get(fidelity.name) == fidelity:
        tested = words.tested if symmetric else words.tested_with_lift
        aim = f"Made for drags within {100 * f.tolerance:g} % over {tested}"

    costs = {
        f"{bodies} bodies of a training": bodies * (takes.flow + takes.renewal),
        "their shape gradients": bodies * takes.adjoint,
        "a design by the flow's adjoint alone": takes.design_flows * (takes.flow + takes.adjoint),
        "one flow to verify a surrogate's design": takes.flow,
    }
    return "\n".join(
        [
            f"Steady laminar flow in {describe_stream(stream)}, "
            f"Re {reynolds[0]:g} to {reynolds[1]:g}.",
            f"Bodies: {_kind(family)}, {family.body_class.size}, {ranges}.",
            f"Grid ({f.name}{_refined(f, fidelity)}): {f.cells} cells per D on a domain "
            f"{sides} D ({cells} cells{f' in its {part}' if part else ''}), where "
            "the flow is non-linear; outside it are the Oseen Green's function G and the momentum "
            f"flux of the far field, a power series in the body's force. {aim}; every solved flow "
            "says whether it meets this, with its expected error and a bound that is made to cover "
            "95 % of the errors.",
            f"Left out: {words.left_out}unsteadiness (the {family.body_class.round_body} "
            f"{words.unsteady} beyond Re {ONSET_OF_INSTABILITY[dimension]:g}, {words.others}), "
            "compressibility, roughness.",
            f"On this machine a convolution with G takes {duration(seconds)}, a flow about "
            f"{takes.flow:.0f} of them. Compilation and the network's own steps apart, this takes:",
            *(
                f"- {what}: {work:,.0f} convolutions with G, {duration(work * seconds)}"
                for what, work in costs.items()
            ),
        ]
    )


def _refined(f, fidelity):
    """Return what is said of a grid whose cells follow thin boundary layers."""
    finer = f", finer than its {fidelity.cells} for thin boundary layers"
    return finer if f.cells > fidelity.cells else ""


def _kind(family):
    """Return the family in a few words: symmetric, or what makes its bodies not so."""
    body = family.body_class
    parts = ["camber"] * bool(body.camber_modes) + ["incidence"] * ("incidence" in body.names)
    return f"family with {' and '.join(parts)}" if parts else "symmetric family"
