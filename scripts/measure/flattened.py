"""The rival in space for flattened bodies: body-fitted finite elements in three dimensions.

Needs NGSolve: pip install -e '.[bench]'.
"""

import math
from typing import Any

from correlations import Ellipsoid
from elements import Elements, Found, Part, cartesian_form, climb, far_in_space, stopwatch
from study import ngsolve

QUARTER = Part(cartesian_form, 4.0, far_in_space)  # by its two mirror planes
MESH = Elements(order=2, box=20.0, wall=0.1, near=0.3, wake=0.8)


def solve_by_elements_in_space(body: Ellipsoid, reynolds: float, mesh: Elements = MESH) -> Found:
    """Steady Navier-Stokes round an ellipsoid of three axes in an unbounded stream.

    Taylor-Hood elements on a quarter of space, curved at the body, Newton's method and a direct
    solver.

    Raises:
      InvalidInput: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    ng = ngsolve()
    grid = ng.Mesh(_mesh(body, mesh))
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


def _mesh(body: Ellipsoid, mesh: Elements) -> Any:
    """Tetrahedra of the quarter y, z > 0: finest at the body, then round it, then in its wake."""
    from netgen import occ

    def box(start, end, sides, width):
        solid = occ.Box((start, 0, 0), (end, *sides))
        solid.maxh = width
        return solid

    sphere, axes = occ.Sphere((0, 0, 0), 1.0), tuple(body)
    stretch = occ.gp_GTrsf(mat=[axes[0], 0, 0, 0, axes[1], 0, 0, 0, axes[2]])
    skin = stretch(sphere)
    for face in skin.faces:
        face.name, face.maxh = "body", mesh.wall
    length, width, height = axes
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
