"""The rival in the plane: body-fitted finite elements (NGSolve) round symmetric bodies."""

from collections.abc import Mapping

from elements import (
    Elements,
    Found,
    Part,
    cartesian_form,
    climb,
    far_in_plane,
    half_plane,
    stopwatch,
)
from study import ngsolve

from surrogate import family_shape

NODES = 400  # of the outline that a spline goes through
ELEMENTS = Elements(wall=0.15, near=0.4, wake=2.0)  # the far field's error is the larger
HALF = Part(cartesian_form, 2.0, far_in_plane)


def solve_by_plane_elements(
    body: Mapping[str, float], reynolds: float, elements: Elements = ELEMENTS
) -> Found:
    """Steady Navier-Stokes round a family body in an unbounded stream.

    Taylor-Hood elements on the half plane y > 0, curved at the body, Newton's method and a direct
    solver. The force is the residual tested with a unit field. Re times the box's reach is to be
    50 or more.

    Raises:
      InvalidInput: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    ng = ngsolve()
    mesh = half_plane(ng, family_shape(body).draw(NODES), elements)
    seconds = stopwatch()
    velocities = ng.VectorH1(
        mesh, order=elements.order, dirichlet="body|stream", dirichlety="axis|body|stream"
    )
    flow = ng.GridFunction(velocities * ng.H1(mesh, order=elements.order - 1))
    return Found(2 * climb(ng, flow, reynolds, HALF), flow.space.ndof, seconds())
