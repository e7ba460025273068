"""Body-fitted finite elements (NGSolve), the rivals of the flow solver, in an unbounded stream.

Steady Navier-Stokes by Taylor-Hood elements that are curved at the body, Newton's method with a
direct solver, and continuation in Re. The drag is the residual tested with a unit velocity on the
body. The sides of the box have the velocity, and the outlet has the traction, of the Oseenlet of
the body's own force. Needs NGSolve: pip install -e '.[bench]'.
"""

import functools
import importlib
import math
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from meshes import Elements, half_plane, quarter
from study import Unavailable
from weak_forms import axisymmetric_form, cartesian_form, green_2d, green_3d, oseenlet

from surrogate import InvalidInput, NotConverged, family_shape

START = 5.0  # highest Re at which Newton's method converges from rest
RISE = 5.0  # largest ratio of successive Re of the continuation
STEPS = 40  # of Newton's method, most of them with the factors of an earlier one
FALL = 0.2  # of a step, over the last one; where steps fall less the Jacobian is factored anew
TOLERANCE = 1e-6
BOX_RATIO = 0.377  # of the errors of Cd in a box and in one of half its size
START_OF_SERIES = 0.5  # Re from which a box of 100 D ends where the series of K0 holds


class ElementResult(NamedTuple):
    """The Cd of a body by finite elements, the unknowns, and the seconds from mesh to Cd."""

    cd: float
    unknowns: int
    seconds: float


class Geometry(NamedTuple):
    """A kind of flow for the finite elements, and the symmetric part of it that is solved.

    ``mesh(ng, shape, elements)`` returns the mesh. ``weak_form(ng, space, reynolds, traction)`` has
    the traction on its outlet. ``green(ng, k, x, distance)`` returns the Green's functions of the
    Oseen operator, with k = Re / 2, and of Laplace's. The whole force is ``multiplicity`` times
    that on the part, Cd is ``scale`` times the force over rho U^2 and D (2-D) or D^2. ``fixed``
    names the Dirichlet boundaries.
    """

    dimension: int
    mesh: Callable
    weak_form: Callable
    green: Callable
    multiplicity: float
    scale: float
    fixed: tuple[tuple[str, str], ...]
    elements: Elements


def ngsolve() -> Any:
    """Return the package of the finite elements, NGSolve.

    Raises:
      Unavailable: It is not installed.
    """
    try:
        return importlib.import_module("ngsolve")
    except ImportError:
        raise Unavailable("the rival needs NGSolve: pip install -e '.[bench]'") from None


def solve_by_elements(
    geometry: Geometry, body: Mapping[str, float], reynolds: float, elements: Elements | None = None
) -> ElementResult:
    """Solve the flow past a body of the family by finite elements.

    Args:
      geometry: The kind of flow.
      body: Parameters of the family by name.
      reynolds: U D / nu; its product with ``elements.box`` is to be 50 or more.
      elements: Of the mesh; by default those of the geometry.

    Raises:
      Unavailable: NGSolve is not installed.
      NotConverged: Newton's method failed.
    """
    ng = ngsolve()
    flow = at_rest(ng, geometry, body, elements or geometry.elements)
    seconds = stopwatch()
    force = solve_by_continuation(ng, flow, reynolds, geometry)
    return ElementResult(geometry.scale * force, flow.space.ndof, seconds())


def reference_cd(
    geometry: Geometry, body: Mapping[str, float], reynolds: float, elements: Elements | None = None
) -> float:
    """Return Cd by ``solve_by_elements``, solved once for all rows of a study that need it.

    The arguments are those of ``solve_by_elements``.
    """
    return _solved_once(geometry, tuple(body.items()), reynolds, elements)


def unbounded_cd(body: Mapping[str, float], reynolds: float) -> float:
    """Return Cd of a body of the 2-D family in an unbounded stream, extrapolated from two boxes.

    Of boxes of 100, 200, 400 and 800 D at Re 1 every difference of Cd is 0.377 of the last.
    """
    boxes = (100.0, 200.0) if reynolds >= START_OF_SERIES else (200.0, 400.0)
    small, large = (
        solve_by_elements(PLANE, body, reynolds, FINE._replace(box=box)).cd for box in boxes
    )
    return large + (large - small) * BOX_RATIO / (1 - BOX_RATIO)


@functools.cache
def _solved_once(geometry, body, reynolds, elements):
    return solve_by_elements(geometry, dict(body), reynolds, elements).cd


def at_rest(ng: Any, geometry: Geometry, body: Mapping[str, float], elements: Elements) -> Any:
    """Return a grid function of velocity and pressure, both zero, on a mesh round the body.

    Args:
      ng: The package NGSolve.
      geometry: The kind of flow.
      body: Parameters of the family by name.
      elements: Of the mesh.

    Raises:
      InvalidInput: The body is flattened but the elements are axisymmetric.
    """
    if geometry.weak_form is axisymmetric_form and body.get("flatness", 1.0) != 1.0:
        raise InvalidInput("axisymmetric elements: flatness must be 1")
    shape = family_shape(body, dimension=geometry.dimension)
    mesh = geometry.mesh(ng, shape, elements)
    velocities = ng.VectorH1(mesh, order=elements.order, **dict(geometry.fixed))
    return ng.GridFunction(velocities * ng.H1(mesh, order=elements.order - 1))


def stopwatch() -> Callable[[], float]:
    """Return a function of the seconds since this call, by processor or clock, whichever is less.

    Waiting threads count as busy processors.
    """
    begin = time.process_time(), time.perf_counter()
    return lambda: min(time.process_time() - begin[0], time.perf_counter() - begin[1])


def solve_by_continuation(
    ng: Any,
    flow: Any,
    reynolds: float,
    geometry: Geometry,
    force: float = 0.0,
    tolerance: float = TOLERANCE,
) -> float:
    """Take the flow to this Re in place; return its force over rho U^2 and D, in 3-D D^2.

    Args:
      ng: The package NGSolve.
      flow: Velocity and pressure, replaced by those at this Re.
      reynolds: U D / nu.
      geometry: The part of the flow that is solved.
      force: That of the flow at a Re near this one; zero of a fluid at rest.
      tolerance: Of force and flow, relative.

    Raises:
      NotConverged: Newton's method failed.
    """
    for number in [reynolds] if force else continuation(reynolds):
        force = _newton(ng, flow, number, force, geometry, tolerance)
    return force


def continuation(reynolds: float) -> Iterator[float]:
    """Yield increasing Reynolds numbers up to this one, in equal ratios."""
    steps = max(math.ceil(math.log(reynolds / START, RISE)), 0)
    for left in range(steps, -1, -1):
        yield reynolds * (START / reynolds) ** (left / max(steps, 1))


class Jacobian:
    """A form's Jacobian matrix by its factors, kept while the steps of Newton's method fall."""

    def __init__(self, form: Any):
        self.form, self.factors, self.last = form, None, math.inf

    def solve(self, ng: Any, flow: Any, residual: Any, change: Any) -> None:
        """Overwrite ``change`` by the Newton step that a residual of the flow asks for.

        Args:
          ng: The package NGSolve.
          flow: At which the form is linearised.
          residual: Of the form.
          change: Is overwritten.

        Raises:
          NotConverged: The Jacobian is singular.
        """
        if self.factors is not None:
            change.data = self.factors * residual
        if self.factors is None or ng.Norm(change) > FALL * self.last:
            self.form.AssembleLinearization(flow.vec)
            try:
                self.factors = self.form.mat.Inverse(flow.space.FreeDofs())
            except Exception as reason:  # of a type that NGSolve does not export
                raise NotConverged("finite elements: a singular Jacobian") from reason
            change.data = self.factors * residual
        self.last = ng.Norm(change)


def _newton(
    ng: Any, flow: Any, reynolds: float, force: float, geometry: Geometry, tolerance: float
) -> float:
    """Solve at one Re, with the far field of the force that is solved for; that force."""
    space, strength = flow.space, ng.Parameter(force)
    velocity, traction = oseenlet(ng, reynolds, space.mesh.dim, geometry.green)
    form = geometry.weak_form(ng, space, reynolds, -strength * traction)
    sides, axial = ng.GridFunction(space), ng.GridFunction(space)
    along = ng.CF((1, 0, 0)[: space.mesh.dim])
    axial.components[0].Set(along, definedon=space.mesh.Boundaries("body"))
    residual, change = flow.vec.CreateVector(), flow.vec.CreateVector()
    free, jacobian = ng.Projector(space.FreeDofs(), True), Jacobian(form)
    for _ in range(STEPS):
        outside = along - strength * velocity
        sides.components[0].Set(outside, definedon=space.mesh.Boundaries("stream"))
        residual.data = free * flow.vec
        flow.vec.data = residual + sides.vec
        form.Apply(flow.vec, residual)
        jacobian.solve(ng, flow, residual, change)
        flow.vec.data -= change
        force = -geometry.multiplicity * ng.InnerProduct(residual, axial.vec)
        settled = abs(force - strength.Get()) < tolerance * force
        if settled and ng.Norm(change) < tolerance * ng.Norm(flow.vec):
            return force
        strength.Set(force)
    raise NotConverged(f"finite elements at Re {reynolds:g}: Newton's method failed")


WALLS = "body|stream"
HALF = (("dirichlet", WALLS), ("dirichlety", f"axis|{WALLS}"))
FEW = Elements(wall=0.15, near=0.4, wake=2.0)  # so few that the far field's error is the larger
FINE = Elements(wall=0.08, near=0.25, wake=1.2)
PLANE = Geometry(2, half_plane, cartesian_form, green_2d, 2.0, 2.0, HALF, FEW)
AXISYMMETRIC = Geometry(
    3, half_plane, axisymmetric_form, green_3d, 2 * math.pi, 8 / math.pi, HALF, Elements()
)
BOX = Elements(order=2, box=20.0, wall=0.1, near=0.3, wake=0.8)
QUARTER = (HALF[0], ("dirichlety", f"flank|{WALLS}"), ("dirichletz", f"floor|{WALLS}"))
FLATTENED = Geometry(3, quarter, cartesian_form, green_3d, 4.0, 8 / math.pi, QUARTER, BOX)
TINY_ELEMENTS = Elements(order=2, box=10.0, wall=0.2, near=0.5)  # of tiny runs, of revolution
