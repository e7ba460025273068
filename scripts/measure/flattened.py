"""The rival in space for flattened bodies: body-fitted finite elements in three dimensions.

Needs NGSolve: pip install -e '.[bench]'.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from elements import Elements, Found, Part, cartesian_form, climb, far_in_space, stopwatch
from study import ngsolve

from surrogate import Shape, family_shape

NODES = 100  # of the outline that a spline goes through
QUARTER = Part(cartesian_form, 4.0, far_in_space)  # by its two mirror planes
MESH = Elements(order=2, box=20.0, wall=0.1, near=0.3, wake=0.8)
FINER = Elements(order=3, box=14.0, wall=0.25, near=0.5, wake=1.2)


def solve_by_elements_in_space(
    body: Mapping[str, float], reynolds: float, mesh: Elements = MESH
) -> Found:
    """Steady Navier-Stokes round a body of the family in an unbounded stream.

    Taylor-Hood elements on a quarter of space, curved at the body, Newton's method and a direct
    solver.

    Raises:
      InvalidInput: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    ng = ngsolve()
    grid = ng.Mesh(_mesh(family_shape(body, dimension=3), mesh))
    grid.Curve(mesh.order)
    seconds = stopwatch()
    velocities = ng.VectorH1(
        grid,
        order=mesh.order,
        dirichlet="body|stream",
        dirichlety="flank|body|stream",
        dirichletz="floor|body|stream",
    )
    flow = ng.GridFunction(velocities * ng.H1(grid, order=mesh.order - 1))
    force = climb(ng, flow, reynolds, QUARTER)
    return Found(8 / math.pi * force, flow.space.ndof, seconds())


def _mesh(body: Shape, mesh: Elements) -> Any:
    """Tetrahedra of the quarter y, z > 0: finest at the body, then round it, then in its wake."""
    from netgen import occ

    def box(start, end, sides, width):
        solid = occ.Box((start, 0, 0), (end, *sides))
        solid.maxh = width
        return solid

    skin = _skin(occ, body)
    for face in skin.faces:
        face.name, face.maxh = "body", mesh.wall
    length, width, height = body.extent / 2
    near = box(-length - 1, length + 2, (width + 1, height + 1), mesh.near)
    wake = box(length + 2, mesh.box, (width + 2, height + 2), mesh.wake)
    far = box(-mesh.box, mesh.box, (mesh.box, mesh.box), mesh.box / 6)
    whole = occ.Glue([near - skin, wake, far - near - wake])
    for face in whole.faces:
        (x, y, z), reach = face.center, mesh.box - 1e-6
        if x > reach:
            face.name = "outlet"
        elif max(-x, y, z) > reach:
            face.name = "stream"
        elif y < 1e-6:
            face.name = "flank"
        elif z < 1e-6:
            face.name = "floor"
    return occ.OCCGeometry(whole).GenerateMesh(grading=0.3)


def _skin(occ: Any, body: Shape) -> Any:
    """The solid body: its outline turned round the axis, then stretched to its width."""
    outline, (length, width, height) = np.asarray(body.draw(NODES)), body.extent
    outline = occ.SplineInterpolation([occ.Pnt(x, r, 0) for x, r in outline], periodic=True)
    upper = occ.MoveTo(-length, 0).Rectangle(2 * length, height).Face()
    half = upper * occ.Face(occ.Wire([outline]))
    solid = half.Revolve(occ.Axis((0, 0, 0), occ.X), 360)
    return occ.gp_GTrsf(mat=[1, 0, 0, 0, width / height, 0, 0, 0, 1])(solid)
