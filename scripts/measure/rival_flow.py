"""The rival of the flow solver: body-fitted finite elements (NGSolve) in a large box.

Needs NGSolve: pip install -e '.[bench]'.
"""

import time
from typing import NamedTuple

from study import ngsolve

from surrogate.errors import NotConverged


class RivalFlow(NamedTuple):
    """Cd of the cylinder, unknowns, seconds from the finished mesh to the drag."""

    cd: float
    unknowns: int
    seconds: float


def solve_by_finite_elements(
    reynolds: float, box: float = 60.0, order: int = 3, wall: float = 0.15
) -> RivalFlow:
    """Steady Navier-Stokes round the cylinder, Taylor-Hood elements, Newton and a direct solver.

    The box is ``box`` D wide, with the free stream on three sides and an outlet; elements are
    curved, ``wall`` D at the body. The force is the residual tested with a unit field.

    Raises:
      InvalidInput: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    ng = ngsolve()
    from netgen.geom2d import SplineGeometry

    outline, half = SplineGeometry(), box / 2
    outline.AddRectangle((-half, -half), (half, half), bcs=["side", "outlet", "side", "inlet"])
    outline.AddCircle((0, 0), r=0.5, leftdomain=0, rightdomain=1, bc="body", maxh=wall)
    mesh = ng.Mesh(outline.GenerateMesh(maxh=box / 8, grading=0.25))
    mesh.Curve(order)
    start = time.perf_counter()
    velocities = ng.VectorH1(mesh, order=order, dirichlet="inlet|side|body")
    space = velocities * ng.H1(mesh, order=order - 1)
    (u, p), (v, q) = space.TnT()
    form = ng.BilinearForm(space)
    viscous = ng.InnerProduct(ng.Grad(u), ng.Grad(v)) / reynolds
    form += (viscous + (ng.Grad(u) * u) * v - ng.div(v) * p - ng.div(u) * q) * ng.dx
    flow, test = ng.GridFunction(space), ng.GridFunction(space)
    stream = ng.CF((1, 0))
    flow.components[0].Set(stream, definedon=mesh.Boundaries("inlet|side"))
    residual, change = flow.vec.CreateVector(), flow.vec.CreateVector()
    for _ in range(20):
        form.Apply(flow.vec, residual)
        form.AssembleLinearization(flow.vec)
        change.data = form.mat.Inverse(space.FreeDofs()) * residual
        flow.vec.data -= change
        if ng.Norm(change) < 1e-8 * ng.Norm(flow.vec):
            break
    else:
        raise NotConverged(f"finite elements at Re {reynolds:g}: Newton's method failed")
    form.Apply(flow.vec, residual)
    test.components[0].Set(stream, definedon=mesh.Boundaries("body"))
    force = -ng.InnerProduct(residual, test.vec)
    return RivalFlow(2 * force, space.ndof, time.perf_counter() - start)
