"""What others have published on bodies of least drag, and how to compare a body of ours with it."""

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from shapeopt.search.verify import CYLINDER, verify
from surrogate.arrays import AnyArray
from surrogate.body.family import family_markers
from surrogate.errors import NotConverged
from surrogate.scene.scene import Scene, Tunnel

FRONT = (0.05, 0.15)  # share of the chord behind the rounded nose that the wedge is read from


class Split(NamedTuple):
    """A drag coefficient by its parts."""

    pressure: float
    friction: float

    @property
    def total(self) -> float:
        return self.pressure + self.friction


class Lens(NamedTuple):
    """A published body of least drag and the cylinder beside it."""

    aspect: float
    cylinder: Split
    optimum: Split


# Chen, Cakal, Hu, Thuerey (J. Fluid Mech. 919, 2021), Re 1 in a finite domain.
LENS = Lens(2.5, Split(5.33, 5.36), Split(2.60, 7.54))

# Pironneau (J. Fluid Mech. 64, 1974): the front of a body of least drag is a wedge.
WEDGE_IN_LAMINAR_FLOW = 90.0  # degrees
WEDGE_IN_STOKES_FLOW = 102.6

# Body-fitted finite elements with their adjoint, six radial modes, a box of 60 D: the fall of
# drag against the cylinder, in percent, by Reynolds number.
BODY_FITTED_GAIN = {1.0: 4.5, 40.0: 25.1}


class Front(NamedTuple):
    """Full opening angles of a nose in degrees: mean tangent, and continued to the wedge's tip."""

    tangent: float
    wedge: float


def front_angles(markers: Float[AnyArray, "nodes 2"]) -> Front:
    """Opening angle of a symmetric contour, clockwise from the nose, by its upper side's front.

    A line through the points at 5 to 15 % of the chord gives the tangent. The front bends, so a
    parabola through the same points is followed to the centre line, where a sharp nose would be;
    of a lens of two arcs that meet at 90 degrees it reads 87.
    """
    upper = np.asarray(markers)[: len(markers) // 2 + 1]
    station = upper[:, 0] - upper[0, 0]
    chord = station[-1]
    front = (station >= FRONT[0] * chord) & (station <= FRONT[1] * chord)
    x, y = station[front], upper[front, 1]
    line, parabola = np.poly1d(np.polyfit(x, y, 1)), np.poly1d(np.polyfit(x, y, 2))
    tips = parabola.roots[np.isreal(parabola.roots)].real
    tip = tips[np.argmin(np.abs(tips))] if len(tips) else 0.0
    slopes = line.coef[0], parabola.deriv()(tip)
    return Front(*(float(2 * np.degrees(np.arctan(slope))) for slope in slopes))


def family_front(parameters: AnyArray) -> Front:
    """Front angles of a family body."""
    return front_angles(family_markers(jnp.asarray(parameters), 4000))


def tunnel_with_drag(scene: Scene, reynolds: float, target: float) -> Tunnel:
    """The slip-walled tunnel in which the cylinder has this drag, to 0.1 %.

    A secant in 1 / height, in which the drag is nearly linear.

    Raises:
      NotConverged: there is none between 12 and 1000 D.
    """

    def excess(height):
        stream = Tunnel(round(height, 1))
        return verify(dataclasses.replace(scene, stream=stream), CYLINDER, reynolds).cd - target

    a, b = 1 / 64, 1 / 96
    excess_a, excess_b = excess(1 / a), excess(1 / b)
    for _ in range(6):
        if abs(excess_b) < 1e-3 * target or excess_a == excess_b:
            break
        a, b = b, b - excess_b * (b - a) / (excess_b - excess_a)
        if not 1e-3 <= b <= 1 / 12:
            break
        excess_a, excess_b = excess_b, excess(1 / b)
    if abs(excess_b) < 1e-3 * target and 1e-3 <= b <= 1 / 12:
        return Tunnel(round(1 / b, 1))
    raise NotConverged(f"no tunnel gives the cylinder Cd {target:g} at Re {reynolds:g}")
