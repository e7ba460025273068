"""The compiled steps behind ``Flow``: solves, the drag with its derivative, many bodies."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.body.outline import family_markers
from surrogate.body.shape import Shape
from surrogate.body.solid import skin
from surrogate.devices import Devices, Partition
from surrogate.errors import NotConverged
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.loads.forces import Coefficients, coefficients, drag_coefficient
from surrogate.flow.loads.forces_3d import space_coefficients
from surrogate.flow.solver import steady
from surrogate.flow.solver.newton import NewtonInfo, NewtonSettings
from surrogate.flow.solver.tangent import Effort, Query, drag_slopes

ADJOINT = Effort(2e-4, 60)
HALVINGS = 3  # of the step in Re, where Newton from the Oseen flow fails


class DragGradient(NamedTuple):
    """Drag and its slopes in parameters and Re, good to three digits; NaN where not converged.

    ``green_applications`` are those of flow and adjoint.
    """

    drag: Float[AnyArray, "*bodies"]
    gradient: Float[AnyArray, "*bodies parameters"]
    by_reynolds: Float[AnyArray, "*bodies"]
    green_applications: Int[AnyArray, "*bodies"]
    converged: Bool[AnyArray, "*bodies"]


class FlowBatch(NamedTuple):
    """Solved flows of many bodies: traction modes, cost, and whether each solve converged."""

    amplitude: Float[AnyArray, "bodies modes"]
    green_applications: Int[AnyArray, " bodies"]
    converged: Bool[AnyArray, " bodies"]

    @property
    def drag(self) -> Float[AnyArray, " bodies"]:
        return jax.vmap(drag_coefficient)(jnp.asarray(self.amplitude))


class FlowResult(NamedTuple):
    """A solved body."""

    state: steady.FlowState
    info: NewtonInfo

    @property
    def drag(self) -> float:
        return float(drag_coefficient(self.state.amplitude))


@functools.partial(jax.jit, static_argnames=("domain", "settings"))
def solve_contour(domain, settings, markers, reynolds, guess=None):
    """Body flow of a contour; ``info.converged`` says whether the numbers mean anything."""
    operators = steady.prepare(domain, markers, reynolds)
    return FlowResult(*steady.body_flow(domain, operators, guess, settings))


def loads(
    domain: Domain, markers: Markers, state: steady.FlowState, reynolds: float
) -> Coefficients:
    """Force coefficients of a solved body."""
    if domain.lattice.dimension == 3:
        return space_coefficients(domain, markers, state, reynolds)
    return _plane_loads(domain, markers, *state, jnp.asarray(reynolds))


_plane_loads = jax.jit(coefficients, static_argnames="domain")


def solve_by_continuation(
    domain: Domain, settings: NewtonSettings, shape: Shape, reynolds: float
) -> tuple[FlowResult, int]:
    """The flow; where Newton from the Oseen flow fails, Re is approached in 2, 4, 8 steps.

    Returns the applications of G of all attempts too, their preparations included.
    """
    markers, spent = shape.markers(domain.nodes), 0
    for depth in range(HALVINGS + 1):
        guess, steps = None, 2**depth
        for k in range(1, steps + 1):
            found = solve_contour(
                domain, settings, markers, jnp.asarray(reynolds * k / steps), guess
            )
            spent += int(found.info.products) + steady.assembly_cost(domain)
            if not bool(found.info.converged):
                break
            guess = found.state
        else:
            return found, spent
    raise NotConverged(not_converged_message(reynolds, found.info))


def not_converged_message(reynolds: float, info: NewtonInfo) -> str:
    """What to say of a flow that was not found."""
    return (
        f"body flow at Re {reynolds:g} did not converge: residual {float(info.residual):.1e} after "
        f"{int(info.steps)} Newton steps; more cells or a lower Re would help"
    )


def gradient_at(
    domain: Domain, settings: NewtonSettings, shape: Shape, reynolds: float, found: FlowResult
) -> dict[str, float]:
    """dCd in a family body's parameters and in ``reynolds``, by name.

    Raises:
      NotConverged: the adjoint was not found.
    """
    at = jnp.asarray(shape.values), jnp.asarray(reynolds)
    slopes = slopes_at(domain, settings, shape.form, *at, found.state)
    flat = np.array([*slopes[0], slopes[1]], float)
    if not np.all(np.isfinite(flat)):
        raise NotConverged(f"adjoint flow at Re {reynolds:g} did not converge")
    return dict(zip((*shape.parameters, "reynolds"), flat.tolist(), strict=True))


@functools.partial(jax.jit, static_argnames=("domain", "settings", "form"))
def slopes_at(domain, settings, form, parameters, reynolds, state, operators=None):
    """dCd/d(parameters, Re) by one adjoint of as many digits as the flow has."""

    def contour(parameters):
        draw = skin if form.dimension == 3 else family_markers
        return draw(parameters, form, domain.nodes)

    if operators is None:
        operators = steady.prepare(domain, contour(parameters), reynolds)
    effort = Effort(settings.linear_tolerance, settings.max_vectors)
    query = Query(contour, parameters, reynolds)
    *slopes, work = drag_slopes(domain, operators, state, query, effort)
    return tuple(jnp.where(work.converged, slope, jnp.nan) for slope in slopes)


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def drag_and_status(flow, parameters, reynolds):
    return _drag_and_state(flow, parameters, reynolds)[0]


@functools.partial(jax.jit, static_argnames="flow")
def _drag_and_state(flow, parameters, reynolds):
    """(Cd, status), and what its derivative needs."""
    operators = steady.prepare(flow.domain, flow.markers(parameters), reynolds)
    state, info = steady.body_flow(flow.domain, operators, settings=flow.settings)
    return (drag_coefficient(state.amplitude), info), (parameters, reynolds, state, operators)


def _drag_slopes(flow, saved, cotangent):
    slopes = slopes_at(flow.domain, flow.settings, flow.scene.family.form, *saved)
    return tuple(cotangent[0] * slope for slope in slopes)


drag_and_status.defvjp(_drag_and_state, _drag_slopes)


@functools.partial(jax.jit, static_argnames="flow")
def drag_and_slope(flow: Any, parameters, reynolds):
    (drag, info), (*_, state, operators) = _drag_and_state(flow, parameters, reynolds)
    query = Query(flow.markers, parameters, reynolds)
    *slopes, work = drag_slopes(flow.domain, operators, state, query, ADJOINT)
    converged = info.converged & work.converged & jnp.all(jnp.isfinite(slopes[0]))
    spent = info.products + work.products + steady.assembly_cost(flow.domain)
    answer = (jnp.where(converged, value, jnp.nan) for value in (drag, *slopes))
    return DragGradient(*answer, spent, converged)


def estimated_cost(
    parameters: Float[AnyArray, "bodies parameters"], reynolds: Float[AnyArray, " bodies"]
) -> Float[np.ndarray, " bodies"]:
    """What the work of flows grows with: Re of the thickness."""
    return np.asarray(reynolds) / np.sqrt(np.asarray(parameters)[:, 0])


@functools.cache
def batch_solver(
    flow: Any, devices: Devices, slopes: bool = False
) -> Callable[[Partition, AnyArray, AnyArray], FlowBatch | DragGradient]:
    """``(partition, parameters, reynolds)`` to the flows of many bodies, compiled."""

    def label(body):
        operators = steady.prepare(flow.domain, flow.markers(body[0]), body[1])
        state, info = steady.body_flow(flow.domain, operators, settings=flow.settings)
        spent = info.products + steady.assembly_cost(flow.domain)
        return FlowBatch(state.amplitude, spent, info.converged)

    def slope(body):
        return drag_and_slope(flow, *body)

    def every(partition, parameters, reynolds):
        one = slope if slopes else label
        return partition.gather(partition.map(one, partition.scatter((parameters, reynolds))))

    return jax.jit(every, compiler_options=devices.options)
