"""Body-fitted finite elements (NGSolve), the rivals of the flow solver, in an unbounded stream.

The sides of the box have the velocity, and the outlet has the traction, of the Oseenlet of the
body's own force. Needs NGSolve: pip install -e '.[bench]'.
"""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from surrogate import NotConverged

START = 5.0  # highest Re that Newton's method is started at from rest
RISE = 5.0  # most that Re then grows by at once
STEPS = 20  # of Newton's method
TOLERANCE = 1e-8
CORNERS = 1e-9  # compressibility, by which elements without free velocities have a pressure


class Elements(NamedTuple):
    """Degree, reach of the box, and widths of elements: on the body, near it, in its wake; in D."""

    order: int = 3
    box: float = 100.0
    wall: float = 0.05
    near: float = 0.2
    wake: float = 1.0


class Found(NamedTuple):
    """Cd of a body, unknowns, seconds from the finished mesh to the Cd by ``stopwatch``."""

    cd: float
    unknowns: int
    seconds: float


class Part(NamedTuple):
    """The part of a flow that is solved: of the whole its share is 1 / ``whole``.

    ``weak_form(ng, space, reynolds, traction)`` has the traction at its outlet; ``far(ng, k, x,
    distance)`` are Green's functions, of the Oseen operator by k = Re / 2 and of Laplace's.
    """

    weak_form: Callable
    whole: float
    far: Callable


def stopwatch() -> Callable[[], float]:
    """Seconds since now: of the processor, or of the clock where waiting threads make it fewer."""
    begin = time.process_time(), time.perf_counter()
    return lambda: min(time.process_time() - begin[0], time.perf_counter() - begin[1])


def cartesian_form(ng: Any, space: Any, reynolds: float, traction: Any) -> Any:
    """Steady Navier-Stokes; traction on the outlet. Corners of the box alone need the last term."""
    (u, p), (v, q) = space.TnT()
    viscous, inertia = ng.InnerProduct(ng.Grad(u), ng.Grad(v)), (ng.Grad(u) * u) * v
    incompressible = p * ng.div(v) + q * ng.div(u) + CORNERS * p * q
    form = ng.BilinearForm(space)
    form += (viscous / reynolds + inertia - incompressible) * ng.dx
    form += -traction * v * ng.ds("outlet")
    return form


def climb(ng: Any, flow: Any, reynolds: float, part: Part) -> float:
    """Take the flow from rest to this Re; its force over rho U^2 and D, in space D^2.

    Raises:
      NotConverged: Newton's method failed.
    """
    force = 0.0
    for number in _ascent(reynolds):
        force = _newton(ng, flow, number, force, part)
    return force


def _ascent(reynolds: float) -> Iterator[float]:
    """Reynolds numbers on the way up, in equal ratios."""
    climbs = max(math.ceil(math.log(reynolds / START, RISE)), 0)
    for left in range(climbs, -1, -1):
        yield reynolds * (START / reynolds) ** (left / max(climbs, 1))


def half_plane(ng: Any, outline: Float[np.ndarray, "nodes 2"], elements: Elements) -> Any:
    """Triangles beside the stream's axis: finest at the body, then round it, then in its wake."""
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
    mesh = ng.Mesh(occ.OCCGeometry(whole, dim=2).GenerateMesh(grading=0.25))
    mesh.Curve(elements.order)
    return mesh


def _newton(ng: Any, flow: Any, reynolds: float, force: float, part: Part) -> float:
    """Take the flow to this Re, the far field along with the force; that force."""
    space, strength = flow.space, ng.Parameter(force)
    velocity, traction = _oseenlet(ng, reynolds, space.mesh.dim, part.far)
    form = part.weak_form(ng, space, reynolds, -strength * traction)
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
        force = -part.whole * ng.InnerProduct(residual, axial.vec)
        settled = abs(force - strength.Get()) < TOLERANCE * force
        if settled and ng.Norm(change) < TOLERANCE * ng.Norm(flow.vec):
            return force
        strength.Set(force)
    raise NotConverged(f"finite elements at Re {reynolds:g}: Newton's method failed")


def _oseenlet(ng: Any, reynolds: float, dimension: int, far: Callable) -> tuple[Any, Any]:
    """Velocity, and traction on planes across the stream, of a unit force at the origin along it.

    Of the Green's functions G and L, u = Re G along x - grad (G - L), p = -dL/dx. Of two
    dimensions the second is the distance from the axis.
    """
    x, *across = (ng.x, ng.y, ng.z)[:dimension]
    distance = ng.sqrt(sum(side**2 for side in (x, *across)))
    green, harmonic = far(ng, reynolds / 2, x, distance)
    potential = green - harmonic
    along = reynolds * green - potential.Diff(x)
    velocity = ng.CF((along, *(-potential.Diff(side) for side in across)))
    pressure = ng.CF((-harmonic.Diff(x), *(0 for _ in across)))
    return velocity, velocity.Diff(x) / reynolds - pressure


def far_in_space(ng: Any, k: float, x: Any, distance: Any) -> tuple[Any, Any]:
    """Green's functions of the Oseen operator and of Laplace's, in three dimensions."""
    sphere = 4 * math.pi * distance
    return ng.exp(k * (x - distance)) / sphere, 1 / sphere


def far_in_plane(ng: Any, k: float, x: Any, distance: Any) -> tuple[Any, Any]:
    """The same in two; K0 by its asymptotic series, which far away has six digits."""
    z = k * distance
    series = 1 - 1 / (8 * z) + 9 / (128 * z**2)
    decay = ng.exp(k * x - z) * ng.sqrt(math.pi / (2 * z)) * series
    return decay / (2 * math.pi), -ng.log(distance) / (2 * math.pi)
