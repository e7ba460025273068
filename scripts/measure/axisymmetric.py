"""The rival in space: body-fitted axisymmetric finite elements (NGSolve) for bodies of revolution.

Needs NGSolve: pip install -e '.[bench]'.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from study import ngsolve

from surrogate import InvalidInput, NotConverged, family_shape

NODES = 400  # of the outline that a spline goes through
START = 5.0  # highest Re that Newton's method is started at from rest
RISE = 5.0  # most that Re then grows by at once
STEPS = 20  # of Newton's method
TOLERANCE = 1e-8


class Elements(NamedTuple):
    """Degree, reach of the box, and widths of elements: on the body, near it, in its wake; in D."""

    order: int = 3
    box: float = 100.0
    wall: float = 0.05
    near: float = 0.2
    wake: float = 1.0


ELEMENTS = Elements()


class Found(NamedTuple):
    """Cd of a body, unknowns, processor seconds from the finished mesh to the Cd."""

    cd: float
    unknowns: int
    seconds: float


def solve_by_axisymmetric_elements(
    body: Mapping[str, float], reynolds: float, elements: Elements = ELEMENTS
) -> Found:
    """Steady Navier-Stokes round a family body of revolution in an unbounded stream.

    Taylor-Hood elements on the half plane (x, r), curved at the body, Newton's method and a direct
    solver. The sides of the box have the velocity, and the outlet has the traction, of the
    Oseenlet of the body's own force. The force is the residual tested with a unit field.

    Raises:
      InvalidInput: NGSolve is not installed, or the body is none of revolution.
      NotConverged: Newton's method failed.
    """
    ng = ngsolve()
    if body.get("flatness", 1.0) != 1.0:
        raise InvalidInput("axisymmetric elements: flatness must be 1")
    mesh = ng.Mesh(_mesh(family_shape(body, dimension=3).draw(NODES), elements))
    mesh.Curve(elements.order)
    start = time.process_time()
    velocities = ng.VectorH1(
        mesh, order=elements.order, dirichlet="body|stream", dirichlety="axis|body|stream"
    )
    flow = ng.GridFunction(velocities * ng.H1(mesh, order=elements.order - 1))
    force = climb(ng, flow, reynolds, _weak_form, 2 * math.pi)
    return Found(8 / math.pi * force, flow.space.ndof, time.process_time() - start)


def climb(ng: Any, flow: Any, reynolds: float, weak_form: Callable, whole: float) -> float:
    """Take the flow from rest to this Re; its force over rho U^2 D^2.

    ``weak_form(ng, space, reynolds, traction)`` is of a part of the flow, ``whole`` times which is
    all of it.
    """
    force = 0.0
    for number in _ascent(reynolds):
        force = _newton(ng, flow, number, force, weak_form, whole)
    return force


def _ascent(reynolds: float) -> Iterator[float]:
    """Reynolds numbers on the way up, in equal ratios."""
    climbs = max(math.ceil(math.log(reynolds / START, RISE)), 0)
    for left in range(climbs, -1, -1):
        yield reynolds * (START / reynolds) ** (left / max(climbs, 1))


def _mesh(outline: Float[np.ndarray, "nodes 2"], elements: Elements) -> Any:
    """Triangles of the half plane r > 0: finest at the body, then round it, then in its wake."""
    from netgen import occ

    def box(start, end, height, width):
        face = occ.MoveTo(start, 0).Rectangle(end - start, height).Face()
        face.faces.maxh = width
        return face

    skin = occ.SplineInterpolation([occ.Pnt(x, r, 0) for x, r in outline], periodic=True)
    skin.name, skin.maxh = "body", elements.wall
    reach, (nose, _), (tail, high) = elements.box, outline.min(axis=0), outline.max(axis=0)
    near = box(nose - 1, tail + 2, high + 1, elements.near)
    wake = box(tail + 2, reach, high + 2, elements.wake)
    far = box(-reach, reach, reach, reach / 8)
    whole = occ.Glue([near - occ.Face(occ.Wire([skin])), wake, far - near - wake])
    for edge in whole.edges:
        x, r, _ = edge.center
        if r < 1e-6:
            edge.name = "axis"
        elif x > reach - 1e-6:
            edge.name = "outlet"
        elif max(-x, r) > reach - 1e-6:
            edge.name = "stream"
    return occ.OCCGeometry(whole, dim=2).GenerateMesh(grading=0.25)


def _newton(
    ng: Any, flow: Any, reynolds: float, force: float, weak_form: Callable, whole: float
) -> float:
    """Take the flow to this Re, the far field along with the force; the force over rho U^2 D^2."""
    space, strength = flow.space, ng.Parameter(force)
    velocity, traction = _oseenlet(ng, reynolds, space.mesh.dim)
    form = weak_form(ng, space, reynolds, -strength * traction)
    sides, axial = ng.GridFunction(space), ng.GridFunction(space)
    along = ng.CF((1, 0, 0)[: space.mesh.dim])
    axial.components[0].Set(along, definedon=space.mesh.Boundaries("body"))
    residual, change = flow.vec.CreateVector(), flow.vec.CreateVector()
    free = ng.Projector(space.FreeDofs(), True)
    for _ in range(STEPS):
        outside = along - strength * velocity
        sides.components[0].Set(outside, definedon=space.mesh.Boundaries("stream"))
        residual.data = free * flow.vec
        flow.vec.data = residual + sides.vec
        form.Apply(flow.vec, residual)
        form.AssembleLinearization(flow.vec)
        change.data = form.mat.Inverse(space.FreeDofs()) * residual
        flow.vec.data -= change
        force = -whole * ng.InnerProduct(residual, axial.vec)
        settled = abs(force - strength.Get()) < TOLERANCE * force
        if settled and ng.Norm(change) < TOLERANCE * ng.Norm(flow.vec):
            return force
        strength.Set(force)
    raise NotConverged(f"finite elements at Re {reynolds:g}: Newton's method failed")


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


def _oseenlet(ng: Any, reynolds: float, dimension: int) -> tuple[Any, Any]:
    """Velocity, and traction on planes across the stream, of a unit force at the origin along it.

    With k = Re / 2 and e = exp(k (x - R)): u = Re e / (4 pi R) along x - grad (e - 1) / (4 pi R),
    p = x / (4 pi R^3). Of two dimensions the second is the distance from the axis.
    """
    x, *across = (ng.x, ng.y, ng.z)[:dimension]
    distance = ng.sqrt(sum(side**2 for side in (x, *across)))
    decay, sphere = ng.exp(reynolds / 2 * (x - distance)), 4 * math.pi * distance
    potential = (decay - 1) / sphere
    along = reynolds * decay / sphere - potential.Diff(x)
    velocity = ng.CF((along, *(-potential.Diff(side) for side in across)))
    pressure = ng.CF((x / (sphere * distance**2), *(0 for _ in across)))
    return velocity, velocity.Diff(x) / reynolds - pressure
