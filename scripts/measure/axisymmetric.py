"""The rival in space for bodies of revolution: axisymmetric finite elements (NGSolve)."""

import math
from collections.abc import Mapping
from typing import Any

from elements import Elements, Found, Part, climb, far_in_space, half_plane, stopwatch
from study import has_ngsolve, ngsolve

from surrogate import InvalidInput, family_shape

NODES = 400  # of the outline that a spline goes through
ELEMENTS = Elements()


def solve_by_axisymmetric_elements(
    body: Mapping[str, float], reynolds: float, elements: Elements = ELEMENTS
) -> Found:
    """Steady Navier-Stokes round a family body of revolution in an unbounded stream.

    Taylor-Hood elements on the half plane (x, r), curved at the body, Newton's method and a direct
    solver. The force is the residual tested with a unit field.

    Raises:
      InvalidInput: NGSolve is not installed, or the body is none of revolution.
      NotConverged: Newton's method failed.
    """
    ng = ngsolve()
    flow = at_rest(ng, body, elements)
    seconds = stopwatch()
    force = climb(ng, flow, reynolds, AZIMUTH)
    return Found(8 / math.pi * force, flow.space.ndof, seconds())


def cd_by_axisymmetric_elements(
    body: Mapping[str, float], reynolds: float, elements: Elements = ELEMENTS
) -> float | None:
    """That Cd, or None where NGSolve is not installed."""
    return solve_by_axisymmetric_elements(body, reynolds, elements).cd if has_ngsolve() else None


def at_rest(ng: Any, body: Mapping[str, float], elements: Elements) -> Any:
    """Velocity and pressure on a mesh round the body, to be solved for."""
    if body.get("flatness", 1.0) != 1.0:
        raise InvalidInput("axisymmetric elements: flatness must be 1")
    mesh = half_plane(ng, family_shape(body, dimension=3).draw(NODES), elements)
    velocities = ng.VectorH1(
        mesh, order=elements.order, dirichlet="body|stream", dirichlety="axis|body|stream"
    )
    return ng.GridFunction(velocities * ng.H1(mesh, order=elements.order - 1))


def _weak_form(ng: Any, space: Any, reynolds: float, traction: Any) -> Any:
    """Steady Navier-Stokes without swirl, per unit azimuth; traction on the outlet."""
    (u, p), (v, q) = space.TnT()
    r = ng.y
    viscous = r * ng.InnerProduct(ng.Grad(u), ng.Grad(v)) + u[1] * v[1] / r
    inertia = r * (ng.Grad(u) * u) * v
    incompressible = p * (r * ng.div(v) + v[1]) + q * (r * ng.div(u) + u[1])
    form = ng.BilinearForm(space)
    form += (viscous / reynolds + inertia - incompressible) * ng.dx(bonus_intorder=2)
    form += -r * traction * v * ng.ds("outlet")
    return form


AZIMUTH = Part(_weak_form, 2 * math.pi, far_in_space)
