"""Weak forms of steady flow for the finite elements, and the Oseenlet in their far field."""

import math
from collections.abc import Callable
from typing import Any

CORNERS = 1e-9  # compressibility, so that corner elements without free velocities have a pressure


def oseenlet(ng: Any, reynolds: float, dimension: int, green: Callable) -> tuple[Any, Any]:
    """Return velocity, and traction on planes across the stream, of a unit force along x.

    The force is at the origin. Of the Green's functions G and L, u = Re G along x - grad (G - L),
    p = -dL/dx. In an axisymmetric mesh the second coordinate is the distance from the axis.
    """
    x, *across = (ng.x, ng.y, ng.z)[:dimension]
    distance = ng.sqrt(sum(side**2 for side in (x, *across)))
    oseen, harmonic = green(ng, reynolds / 2, x, distance)
    potential = oseen - harmonic
    along = reynolds * oseen - potential.Diff(x)
    velocity = ng.CF((along, *(-potential.Diff(side) for side in across)))
    pressure = ng.CF((-harmonic.Diff(x), *(0 for _ in across)))
    return velocity, velocity.Diff(x) / reynolds - pressure


def green_3d(ng: Any, k: float, x: Any, distance: Any) -> tuple[Any, Any]:
    """Return the Green's functions of the Oseen operator and of Laplace's in 3-D.

    Args:
      ng: The package NGSolve.
      k: Re / 2.
      x: Coordinate along the stream.
      distance: From the origin.
    """
    sphere = 4 * math.pi * distance
    return ng.exp(k * (x - distance)) / sphere, 1 / sphere


def green_2d(ng: Any, k: float, x: Any, distance: Any) -> tuple[Any, Any]:
    """Return the Green's functions of the Oseen operator and of Laplace's in 2-D, as ``green_3d``.

    K0 is taken by its asymptotic series, which has six digits in the far field.
    """
    z = k * distance
    series = 1 - 1 / (8 * z) + 9 / (128 * z**2)
    decay = ng.exp(k * x - z) * ng.sqrt(math.pi / (2 * z)) * series
    return decay / (2 * math.pi), -ng.log(distance) / (2 * math.pi)


def cartesian_form(ng: Any, space: Any, reynolds: float, traction: Any) -> Any:
    """Return the weak form of steady flow in 2-D or 3-D, with a traction on the outlet.

    Args:
      ng: The package NGSolve.
      space: Of velocity and pressure.
      reynolds: U D / nu.
      traction: On the outlet.
    """
    (u, p), (v, q) = space.TnT()
    viscous, inertia = ng.InnerProduct(ng.Grad(u), ng.Grad(v)), (ng.Grad(u) * u) * v
    incompressible = p * ng.div(v) + q * ng.div(u) + CORNERS * p * q
    form = ng.BilinearForm(space)
    form += (viscous / reynolds + inertia - incompressible) * ng.dx
    form += -traction * v * ng.ds("outlet")
    return form


def axisymmetric_form(ng: Any, space: Any, reynolds: float, traction: Any) -> Any:
    """Return the weak form of steady axisymmetric flow without swirl, per unit azimuth.

    The arguments are those of ``cartesian_form``.
    """
    (u, p), (v, q) = space.TnT()
    r = ng.y
    viscous = r * ng.InnerProduct(ng.Grad(u), ng.Grad(v)) + u[1] * v[1] / r
    inertia = r * (ng.Grad(u) * u) * v
    incompressible = p * (r * ng.div(v) + v[1]) + q * (r * ng.div(u) + u[1])
    form = ng.BilinearForm(space)
    form += (viscous / reynolds + inertia - incompressible) * ng.dx(bonus_intorder=2)
    form += -r * traction * v * ng.ds("outlet")
    return form
