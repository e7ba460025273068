"""Body-fitted finite elements (NGSolve) past bodies with lift: drag, lift and moment.

As ``elements``, without the mirror plane along the stream: the sides of the box have the velocity,
and the outlet the traction, of the Oseenlets of the body's own drag and lift. Of 3-D bodies the
half y > 0 is solved.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from elements import (
    BOX,
    BOX_RATIO,
    START_OF_SERIES,
    STEPS,
    TOLERANCE,
    Jacobian,
    continuation,
    ngsolve,
)
from meshes import Elements, half, whole_plane
from numpy.typing import ArrayLike
from weak_forms import cartesian_form, green_2d, green_3d

from surrogate import NotConverged, Shape, family_shape

SECTION = Elements(wall=0.06, near=0.2, wake=1.0)
AXIS = 1e-9  # of the wake parabola k (r - x), so that quotients by it are finite on the x axis


class ElementLoads(NamedTuple):
    """The loads of a body: Cd, Cl and Cm (about the centroid, nose up)."""

    cd: float
    cl: float
    cm: float


def unbounded_loads(
    body: Shape | Mapping[str, float], reynolds: float, elements: Elements = SECTION
) -> ElementLoads:
    """Return the loads of a 2-D body in an unbounded stream, extrapolated as ``unbounded_cd``.

    Raises:
      Unavailable: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    boxes = (100.0, 200.0) if reynolds >= START_OF_SERIES else (200.0, 400.0)
    small, large = (
        np.array(loads_by_elements(body, reynolds, elements._replace(box=box))) for box in boxes
    )
    return ElementLoads(*(large + (large - small) * BOX_RATIO / (1 - BOX_RATIO)).tolist())


def loads_by_elements(
    body: Shape | Mapping[str, float], reynolds: float, elements: Elements = SECTION
) -> ElementLoads:
    """Return the loads of a 2-D body in one box.

    Raises:
      Unavailable: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    ng, shape = ngsolve(), body if isinstance(body, Shape) else family_shape(body)
    flow = section_at_rest(ng, shape, elements)
    return ElementLoads(*(2 * raise_reynolds(ng, flow, continuation(reynolds))).tolist())


def loads_in_space(
    body: Mapping[str, float], reynolds: float, elements: Elements = BOX
) -> ElementLoads:
    """Return the loads of a 3-D body in one box, whose far field is that of its force.

    Elements of third degree start from the flow in elements of second degree on the same mesh,
    which takes a fraction of the time.

    Raises:
      Unavailable: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    ng = ngsolve()
    mesh, numbers = half(ng, family_shape(body, dimension=3), elements), continuation(reynolds)
    fixed = {"dirichlet": "body|stream", "dirichlety": "flank|body|stream"}
    flow, loads = None, np.zeros(3)
    for order in range(2, elements.order + 1):
        velocities = ng.VectorH1(mesh, order=order, **fixed)
        finer = ng.GridFunction(velocities * ng.H1(mesh, order=order - 1))
        for to, known in zip(finer.components, flow.components if flow else (), strict=False):
            to.Set(known)
        flow, loads = finer, raise_reynolds(ng, finer, numbers, loads)
        numbers = (reynolds,)
    return ElementLoads(*(8 / np.pi * loads).tolist())


def section_at_rest(ng: Any, shape: Shape, elements: Elements) -> Any:
    """Return a grid function of velocity and pressure, both zero, on a mesh of the plane."""
    mesh = whole_plane(ng, shape, elements)
    velocities = ng.VectorH1(mesh, order=elements.order, dirichlet="body|stream")
    return ng.GridFunction(velocities * ng.H1(mesh, order=elements.order - 1))


def raise_reynolds(
    ng: Any, flow: Any, numbers: Iterable[float], loads: ArrayLike = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """Take the flow from Re to Re in place; return its forces and moment over rho U^2 and D.

    In 3-D they are over D^2 and D^3, of the whole body.

    Args:
      ng: The package NGSolve.
      flow: Velocity and pressure, replaced by those at the last Re.
      numbers: Reynolds numbers, one after another.
      loads: Drag, lift and moment of the flow at the start.

    Raises:
      NotConverged: Newton's method failed.
    """
    loads = np.asarray(loads)
    for number in numbers:
        loads = _newton(ng, flow, number, loads)
    return loads


def _newton(ng: Any, flow: Any, reynolds: float, loads: np.ndarray) -> np.ndarray:
    """Solve at one Re with the far field of the force that is solved for; force and moment."""
    space, dimension = flow.space, flow.space.mesh.dim
    multiplicity = dimension - 1  # in 3-D the half is solved
    strength = drag, lift = [ng.Parameter(force) for force in loads[:2]]
    (by_drag, pull), (by_lift, push) = oseenlets(ng, reynolds, dimension)
    velocity, traction = drag * by_drag + lift * by_lift, drag * pull + lift * push
    form = cartesian_form(ng, space, reynolds, -traction)
    width, up = (0,) * (dimension - 2), ng.y if dimension == 2 else ng.z
    sides, along = ng.GridFunction(space), ng.CF((1, *width, 0))
    rigid = []
    for motion in (along, ng.CF((0, *width, 1)), ng.CF((up, *width, -ng.x))):
        rigid.append(ng.GridFunction(space))
        rigid[-1].components[0].Set(motion, definedon=space.mesh.Boundaries("body"))
    residual, change = flow.vec.CreateVector(), flow.vec.CreateVector()
    free, jacobian = ng.Projector(space.FreeDofs(), True), Jacobian(form)
    for _ in range(STEPS):
        sides.components[0].Set(along - velocity, definedon=space.mesh.Boundaries("stream"))
        residual.data = free * flow.vec
        flow.vec.data = residual + sides.vec
        form.Apply(flow.vec, residual)
        jacobian.solve(ng, flow, residual, change)
        flow.vec.data -= change
        loads = np.array([-ng.InnerProduct(residual, motion.vec) for motion in rigid])
        loads *= multiplicity
        gap = max(abs(f - s.Get()) for f, s in zip(loads[:2], strength, strict=True))
        if gap < TOLERANCE * loads[0] and ng.Norm(change) < TOLERANCE * ng.Norm(flow.vec):
            return loads
        for force, parameter in zip(loads[:2], strength, strict=True):
            parameter.Set(force)
    raise NotConverged(f"finite elements at Re {reynolds:g}: Newton's method failed")


def oseenlets(ng: Any, reynolds: float, dimension: int = 2) -> list[tuple[Any, Any]]:
    """Return the velocities and tractions of unit forces on the body along drag and along lift.

    The tractions are those on planes x = const. With G and L as in ``weak_forms``: a force along x
    drives Re G along x - grad (G - L), one along the lift Re G along it - grad dQ, where in 3-D
    dQ = (lift coordinate) k (1 - exp(-s)) / (4 pi r s), s = k (r - x). In 2-D that is the curl
    (-d/dy, d/dx) of G - L. The pressures are minus the derivatives of L.
    """
    if dimension == 2:
        axes, green = (ng.x, ng.y), green_2d
    else:
        axes, green = (ng.x, ng.y, ng.z), green_3d
    x, *_, up = axes
    k, distance = reynolds / 2, ng.sqrt(sum(side**2 for side in axes))
    oseen, harmonic = green(ng, k, x, distance)
    potential = oseen - harmonic
    gradient = [potential.Diff(side) for side in axes]
    drag = ng.CF((reynolds * oseen - gradient[0], *(-part for part in gradient[1:])))
    if dimension == 2:
        lift = ng.CF((-gradient[1], gradient[0]))
    else:
        parabola = k * (distance - x) + AXIS
        slope = up * k * (1 - ng.exp(-parabola)) / (4 * np.pi * distance * parabola)
        lift = ng.CF((-slope.Diff(x), -slope.Diff(ng.y), reynolds * oseen - slope.Diff(up)))
    pressures = -harmonic.Diff(x), -harmonic.Diff(up)
    across = (0,) * (dimension - 1)
    return [
        (velocity, velocity.Diff(x) / reynolds - ng.CF((pressure, *across)))
        for velocity, pressure in zip((drag, lift), pressures, strict=True)
    ]
