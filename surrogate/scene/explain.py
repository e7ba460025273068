"""A scene in words, before long work: what is modelled, what is left out, what it will cost."""

import math
from typing import Any

from surrogate.scene.cost import APPLICATIONS, application_seconds
from surrogate.scene.limits import ONSET_OF_SHEDDING
from surrogate.scene.stream import describe_stream, window_height


def explained(scene: Any, bodies: int) -> str:
    """What a ``Scene`` says of itself, of so many bodies and of a design."""
    f, space = scene.reaching, scene.dimension == 3
    height = window_height(scene.stream, f.height)
    rows = round(height * f.cells / 2)
    shape = round((f.upstream + f.downstream) * f.cells), *(rows,) * (scene.dimension - 1)
    seconds = application_seconds(shape)
    across = f"{height:g} x {height:g}" if space else f"{height:g}"

    def cost(applications):
        return f"{applications:,.0f} applications of G, {applications * seconds:.2g} s"

    bounds = ", ".join(f"{name} {a:g} to {b:g}" for name, (a, b) in scene.family.ranges)
    takes = APPLICATIONS[scene.dimension]
    design = takes.design_flows * (takes.flow + takes.adjoint)
    return "\n".join(
        [
            f"Steady laminar flow in {describe_stream(scene.stream)}, "
            f"Re {scene.reynolds[0]:g} to {scene.reynolds[1]:g}.",
            f"Bodies: symmetric family, {'volume pi/6' if space else 'area pi/4'}, {bounds}.",
            f"Grid ({f.name}): {f.cells} cells per D on a window {f.upstream + f.downstream:g} "
            f"x {across} D ({math.prod(shape)} cells in its "
            f"{'quarter' if space else 'upper half'}), where the flow "
            "is non-linear; outside it the Oseen Green's function G and the far field's "
            f"momentum flux are exact to F^2. Made for drags within {100 * f.promise:g} % over "
            + (
                "Re 0.1 to 100 and aspect 0.5 to 4."
                if space
                else "Re 0.5 to 45 and aspect 0.5 to 5; longer wakes get a longer window."
            ),
            "Left out: "
            + ("" if space else "the third dimension, ")
            + "unsteadiness (bluff bodies shed vortices beyond "
            f"Re {ONSET_OF_SHEDDING[scene.dimension]:g}"
            + (", those shorter than wide sooner" if space else "")
            + "), compressibility, roughness.",
            f"On this machine one application of G takes {1e3 * seconds:.2g} ms, so {bodies} "
            f"bodies of a training cost {cost(bodies * takes.flow)}, their shape "
            f"gradients {cost(bodies * takes.adjoint)}; a design by the flow's adjoint "
            f"alone {cost(design)}; one flow to verify a surrogate's design "
            f"{cost(takes.flow)}. Compilation and the network's own steps come on top.",
        ]
    )
