"""Body-fitted finite elements (NGSolve) past a whole 2-D body: drag, lift and moment.

As ``elements``, without a mirror plane: the sides of the box have the velocity, and the outlet the
traction, of the Oseenlets of the body's own drag and lift.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from elements import (
    BOX_RATIO,
    START_OF_SERIES,
    STEPS,
    TOLERANCE,
    cartesian_form,
    continuation,
    green_2d,
    ngsolve,
)
from meshes import Elements, whole_plane
from numpy.typing import ArrayLike

from surrogate import NotConverged, Shape, family_shape

SECTION = Elements(wall=0.06, near=0.2, wake=1.0)


class Loads(NamedTuple):
    """Cd, Cl and Cm (about the centroid, nose up) of a 2-D body."""

    cd: float
    cl: float
    cm: float


def unbounded_loads(
    body: Shape | Mapping[str, float], reynolds: float, elements: Elements = SECTION
) -> Loads:
    """Loads of a 2-D body in an unbounded stream, extrapolated from two boxes as ``unbounded_cd``.

    Raises:
      Unavailable: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    boxes = (100.0, 200.0) if reynolds >= START_OF_SERIES else (200.0, 400.0)
    small, large = (
        np.array(loads_by_elements(body, reynolds, elements._replace(box=box))) for box in boxes
    )
    return Loads(*(large + (large - small) * BOX_RATIO / (1 - BOX_RATIO)).tolist())


def loads_by_elements(
    body: Shape | Mapping[str, float], reynolds: float, elements: Elements = SECTION
) -> Loads:
    """Loads of a 2-D body in one box.

    Raises:
      Unavailable: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    ng, shape = ngsolve(), body if isinstance(body, Shape) else family_shape(body)
    flow = section_at_rest(ng, shape, elements)
    return Loads(*(2 * raise_reynolds(ng, flow, continuation(reynolds))).tolist())


def section_at_rest(ng: Any, shape: Shape, elements: Elements) -> Any:
    """Velocity and pressure, both zero, on a mesh of the plane round the body."""
    mesh = whole_plane(ng, shape, elements)
    velocities = ng.VectorH1(mesh, order=elements.order, dirichlet="body|stream")
    return ng.GridFunction(velocities * ng.H1(mesh, order=elements.order - 1))


def raise_reynolds(
    ng: Any, flow: Any, numbers: Iterable[float], loads: ArrayLike = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """Take the flow with these loads from Re to Re; force and moment over rho U^2 and D there.

    Raises:
      NotConverged: Newton's method failed.
    """
    loads = np.asarray(loads)
    for number in numbers:
        loads = _newton(ng, flow, number, loads)
    return loads


def _newton(ng: Any, flow: Any, reynolds: float, loads: np.ndarray) -> np.ndarray:
    """Solve at one Re with the far field of the force that is solved for; force and moment."""
    space = flow.space
    strength = drag, lift = [ng.Parameter(force) for force in loads[:2]]
    (by_drag, pull), (by_lift, push) = oseenlets(ng, reynolds)
    velocity, traction = drag * by_drag + lift * by_lift, drag * pull + lift * push
    form = cartesian_form(ng, space, reynolds, -traction)
    sides, along = ng.GridFunction(space), ng.CF((1, 0))
    rigid = []
    for motion in (along, ng.CF((0, 1)), ng.CF((ng.y, -ng.x))):
        rigid.append(ng.GridFunction(space))
        rigid[-1].components[0].Set(motion, definedon=space.mesh.Boundaries("body"))
    residual, change = flow.vec.CreateVector(), flow.vec.CreateVector()
    free = ng.Projector(space.FreeDofs(), True)
    for _ in range(STEPS):
        sides.components[0].Set(along - velocity, definedon=space.mesh.Boundaries("stream"))
        residual.data = free * flow.vec
        flow.vec.data = residual + sides.vec
        form.Apply(flow.vec, residual)
        form.AssembleLinearization(flow.vec)
        change.data = form.mat.Inverse(space.FreeDofs()) * residual
        flow.vec.data -= change
        loads = np.array([-ng.InnerProduct(residual, motion.vec) for motion in rigid])
        gap = max(abs(f - s.Get()) for f, s in zip(loads[:2], strength, strict=True))
        if gap < TOLERANCE * loads[0] and ng.Norm(change) < TOLERANCE * ng.Norm(flow.vec):
            return loads
        for force, parameter in zip(loads[:2], strength, strict=True):
            parameter.Set(force)
    raise NotConverged(f"finite elements at Re {reynolds:g}: Newton's method failed")


def oseenlets(ng: Any, reynolds: float) -> list[tuple[Any, Any]]:
    """Velocity, and traction on planes x = const, of unit forces on the body along x and y.

    With G and L as in ``elements``: a force along x drives Re G along x - grad (G - L), one along y
    the curl (-d/dy, d/dx) of G - L; their pressures are -dL/dx and -dL/dy.
    """
    x, y = ng.x, ng.y
    oseen, harmonic = green_2d(ng, reynolds / 2, x, ng.sqrt(x**2 + y**2))
    potential = oseen - harmonic
    drag = ng.CF((reynolds * oseen - potential.Diff(x), -potential.Diff(y)))
    lift = ng.CF((-potential.Diff(y), potential.Diff(x)))
    pressures = -harmonic.Diff(x), -harmonic.Diff(y)
    return [
        (velocity, velocity.Diff(x) / reynolds - ng.CF((pressure, 0)))
        for velocity, pressure in zip((drag, lift), pressures, strict=True)
    ]
