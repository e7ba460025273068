"""The flow as a drag model: the one way to solve a body."""

import dataclasses
import functools
import time
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray, Body, Number
from surrogate.body.family import LEAST_OPENING, family_markers, modes_of, opening
from surrogate.body.shape import Shape, family_shape
from surrogate.checks import traced
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.check.trust import Trust, judge
from surrogate.flow.grid.domain import Domain, fitted_domain, scene_domain
from surrogate.flow.loads.forces import Coefficients, coefficients, drag_coefficient
from surrogate.flow.solution import Solution
from surrogate.flow.solver import steady
from surrogate.flow.solver.newton import NewtonInfo, NewtonSettings
from surrogate.flow.solver.tangent import Effort, drag_slope, with_body
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.scene import ONSET_OF_SHEDDING, REYNOLDS, Scene, check_reynolds

ADJOINT = Effort(2e-4, 40)
HALVINGS = 3  # of the step in Re, where Newton from the Oseen flow fails
NODES_TO_FIT = 400


class Slope(NamedTuple):
    """Drag and its gradient in the parameters, good to three digits; NaN where not converged.

    ``green_applications`` are those of flow and adjoint.
    """

    drag: Float[Array, ""]
    gradient: Float[Array, " parameters"]
    green_applications: Int[Array, ""]
    converged: Bool[Array, ""]


class Labels(NamedTuple):
    """Solved flows of many bodies: traction modes, cost, and whether each solve converged."""

    amplitude: Float[AnyArray, "bodies modes"]
    green_applications: Int[AnyArray, " bodies"]
    converged: Bool[AnyArray, " bodies"]

    @property
    def drag(self) -> Float[AnyArray, " bodies"]:
        return jax.vmap(drag_coefficient)(jnp.asarray(self.amplitude))


@dataclasses.dataclass(frozen=True)
class Flow:
    """The steady flow of a scene: a drag model, compiled once.

    Bodies are arrays of the parameters of the scene's family, solved on one grid that holds them
    all. ``solve`` takes any other ``Shape`` too, on a grid and window that fit it.
    """

    scene: Scene
    settings: NewtonSettings = NewtonSettings()

    def __post_init__(self):
        if not isinstance(self.scene, Scene):
            raise InvalidInput(f"flow: {self.scene!r} is no Scene")

    @functools.cached_property
    def domain(self) -> Domain:
        """The scene's discretisation."""
        return scene_domain(self.scene)

    def markers(self, parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, "nodes 2"]:
        """Contour of a family body as the scene's grid takes it."""
        return self.scene.family.markers(parameters, self.domain.nodes)

    def drag(
        self,
        parameters: Body,
        reynolds: Number,
        allow_unsteady: bool = False,
    ) -> Float[Array, ""]:
        """Cd = 2 Fx per unit span of a family body; jit, vmap, jax.grad in both arguments.

        Under a transformation, what cannot be answered is NaN.

        Raises:
          InvalidInput: no such body or Reynolds number, or beyond what the scene's grid is for.
          NotConverged: the flow was not found.
        """
        if not traced(parameters, reynolds):
            parameters, reynolds = self._checked(parameters, reynolds, allow_unsteady)
        re = jnp.asarray(reynolds, float)
        cd, info = _drag(self, jnp.asarray(parameters, float), re)
        if traced(parameters, reynolds):
            known = info.converged & self._answers(parameters, re, allow_unsteady)
            return cd * jnp.where(known, 1.0, jnp.nan)  # so is its gradient
        if not bool(info.converged):
            raise NotConverged(_failure(float(reynolds), info))
        return cd

    def slope(self, parameters: Body, reynolds: Number) -> Slope:
        """Drag and shape gradient by one adjoint of few digits, cheaper than ``jax.grad``."""
        return _slope(self, jnp.asarray(parameters, float), jnp.asarray(reynolds, float))

    def labels(
        self,
        parameters: Float[AnyArray, "bodies parameters"],
        reynolds: Float[AnyArray, " bodies"],
    ) -> Labels:
        """Flows of many bodies, one after another: what trainings learn and are tested by.

        Raises:
          NotConverged: a flow was not found.
        """
        found = _labels(self, jnp.asarray(parameters, float), jnp.asarray(reynolds, float))
        if missing := int(np.sum(~np.asarray(found.converged))):
            raise NotConverged(f"{missing} of {len(found.converged)} flows did not converge")
        return found

    def solve(
        self,
        body: Shape | Body,
        reynolds: Number,
        *,
        gradient: bool = False,
        estimate: bool = True,
        allow_unsteady: bool = False,
    ) -> Solution:
        """Loads, fields, work and trust of one body.

        Args:
          body: parameters of the scene's family, on the scene's grid; or a ``Shape``, on a grid
            that fits it in the scene's stream at the scene's fidelity.
          reynolds: U D / nu.
          gradient: dCd/d(parameters, Re) as well; of symmetric family bodies.
          estimate: of the error and the status it means, for two thirds of the cost more.
          allow_unsteady: the steady flow beyond the onset of shedding is wanted all the same.

        Raises:
          InvalidInput: no such body or Reynolds number, or they do not fit grid or stream.
          NotConverged: the flow, or the adjoint that the gradient needs, was not found.
        """
        if isinstance(body, Shape):
            reynolds = check_reynolds(reynolds, allow_unsteady)
            shape, domain = body, _fit(self.scene, body, self.scene.fidelity, reynolds)
        else:
            parameters, reynolds = self._checked(body, reynolds, allow_unsteady)
            shape, domain = family_shape(self.scene.family.named(parameters)), self.domain
        if gradient and (shape.parameters is None or not shape.symmetric):
            raise InvalidInput("gradient: is for bodies of the family at zero incidence")
        start = time.perf_counter()
        found, work = _approach(domain, self.settings, shape, reynolds)
        seconds = time.perf_counter() - start
        force = {name: float(value) for name, value in found.forces._asdict().items()}
        slopes = _gradient(domain, self.settings, shape, reynolds, found) if gradient else None
        trust = self._judged(force["drag"], shape, reynolds) if estimate else None
        return Solution(
            reynolds=reynolds,
            **force,
            status=trust.status if trust else "unknown",
            estimated_error=trust.estimated_error if trust else None,
            green_applications=work,
            newton_steps=int(found.info.steps),
            seconds=seconds,
            gradient=slopes,
            shape=shape,
            domain=domain,
            state=found.state,
        )

    def _judged(self, drag: float, shape: Shape, reynolds: float) -> Trust:
        def solve(fidelity: Fidelity) -> tuple[float, int]:
            domain = _fit(self.scene, shape, fidelity, reynolds)
            found, work = _approach(domain, self.settings, shape, reynolds)
            return float(found.forces.drag), work

        height = float(np.ptp(shape.draw(NODES_TO_FIT)[:, 1]))
        return judge(drag, solve, self.scene.fidelity, reynolds, height)

    def _answers(self, parameters, reynolds, allow_unsteady):
        """What ``_checked`` asks of numbers, of traced ones."""
        highest = min(self.scene.reynolds[1], np.inf if allow_unsteady else ONSET_OF_SHEDDING)
        reach = jnp.abs(self.markers(parameters)).max(axis=0)
        body = opening(parameters, self.scene.family.modes) >= LEAST_OPENING
        body &= jnp.all(reach <= self.domain.reach)
        return body & (reynolds >= REYNOLDS[0]) & (reynolds <= highest * (1 + 1e-9))

    def _checked(self, parameters, reynolds, allow_unsteady):
        """Body and Re as numbers that the scene's grid can take."""
        body = self.scene.family.check(parameters)
        value = check_reynolds(reynolds, allow_unsteady)
        highest = self.scene.reynolds[1]
        if value > highest * (1 + 1e-9):
            raise InvalidInput(
                f"Reynolds number {value:g}: the scene's window is made for wakes up to Re "
                f"{highest:g}; a Scene that reaches further would do"
            )
        if np.any(np.abs(self.markers(body)).max(axis=0) > self.domain.reach):
            raise InvalidInput("body: reaches beyond the bodies that the scene's grid was made for")
        return body, value


class _Found(NamedTuple):
    state: steady.FlowState
    forces: Coefficients
    info: NewtonInfo


def _fit(scene: Scene, shape: Shape, fidelity: Fidelity, reynolds: float) -> Domain:
    outline = shape.draw(NODES_TO_FIT)
    return fitted_domain(scene.stream, fidelity, outline, shape.symmetric, reynolds)


@functools.partial(jax.jit, static_argnames=("domain", "settings"))
def _solve(domain, settings, markers, reynolds, guess=None):
    """Body flow of a contour; ``info.converged`` says whether the numbers mean anything."""
    case = steady.prepare(domain, markers, reynolds)
    state, info = steady.body_flow(domain, case, guess, settings)
    return _Found(state, coefficients(domain, markers, *state, reynolds), info)


def _approach(
    domain: Domain, settings: NewtonSettings, shape: Shape, reynolds: float
) -> tuple[_Found, int]:
    """The flow; where Newton from the Oseen flow fails, Re is approached in 2, 4, 8 steps.

    Returns the applications of G of all attempts too, their preparations included.
    """
    markers, spent = jnp.asarray(shape.draw(domain.nodes)), 0
    for depth in range(HALVINGS + 1):
        guess, steps = None, 2**depth
        for k in range(1, steps + 1):
            found = _solve(domain, settings, markers, jnp.asarray(reynolds * k / steps), guess)
            spent += int(found.info.products) + steady.preparation_cost(domain)
            if not bool(found.info.converged):
                break
            guess = found.state
        else:
            return found, spent
    raise NotConverged(_failure(reynolds, found.info))


def _failure(reynolds, info):
    return (
        f"body flow at Re {reynolds:g} did not converge: residual {float(info.residual):.1e} after "
        f"{int(info.steps)} Newton steps; more cells or a lower Re would help"
    )


def _gradient(domain, settings, shape, reynolds, found) -> dict[str, float]:
    names, values = tuple(shape.parameters), jnp.array(list(shape.parameters.values()))
    slopes = _slopes(domain, settings, modes_of(names), values, jnp.asarray(reynolds), found.state)
    flat = np.array([*slopes[0], slopes[1]], float)
    if not np.all(np.isfinite(flat)):
        raise NotConverged(f"adjoint flow at Re {reynolds:g} did not converge")
    return dict(zip((*names, "reynolds"), flat.tolist(), strict=True))


@functools.partial(jax.jit, static_argnames=("domain", "settings", "modes"))
def _slopes(domain, settings, modes, parameters, reynolds, state, case=None):
    """dCd/d(parameters, Re) by one adjoint, back through the kernel and the far field as well."""

    def rebuild(parameters, reynolds):
        return steady.prepare(domain, family_markers(parameters, modes, domain.nodes), reynolds)

    case = rebuild(parameters, reynolds) if case is None else case
    effort = Effort(settings.linear_tolerance, settings.max_vectors)
    slopes, work = drag_slope(domain, case, state, rebuild, (parameters, reynolds), effort)
    return jax.tree.map(lambda slope: jnp.where(work.converged, slope, jnp.nan), slopes)


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def _drag(flow, parameters, reynolds):
    return _drag_and_state(flow, parameters, reynolds)[0]


@functools.partial(jax.jit, static_argnames="flow")
def _drag_and_state(flow, parameters, reynolds):
    """(Cd, status), and what its derivative needs."""
    case = steady.prepare(flow.domain, flow.markers(parameters), reynolds)
    state, info = steady.body_flow(flow.domain, case, settings=flow.settings)
    return (drag_coefficient(state.amplitude), info), (parameters, reynolds, state, case)


def _drag_slopes(flow, saved, cotangent):
    slopes = _slopes(flow.domain, flow.settings, flow.scene.family.modes, *saved)
    return jax.tree.map(lambda slope: cotangent[0] * slope, slopes)


_drag.defvjp(_drag_and_state, _drag_slopes)


@functools.partial(jax.jit, static_argnames="flow")
def _slope(flow: Flow, parameters, reynolds):
    (drag, info), (*_, state, case) = _drag_and_state(flow, parameters, reynolds)

    def rebuild(parameters):
        return with_body(flow.domain, case, flow.markers(parameters))

    (gradient,), work = drag_slope(flow.domain, case, state, rebuild, (parameters,), ADJOINT)
    converged = info.converged & work.converged & jnp.all(jnp.isfinite(gradient))
    spent = info.products + work.products + steady.preparation_cost(flow.domain)
    drag, gradient = (jnp.where(converged, value, jnp.nan) for value in (drag, gradient))
    return Slope(drag, gradient, spent, converged)


@functools.partial(jax.jit, static_argnames="flow")
def _labels(flow: Flow, parameters, reynolds):
    def one(body):
        case = steady.prepare(flow.domain, flow.markers(body[0]), body[1])
        state, info = steady.body_flow(flow.domain, case, settings=flow.settings)
        spent = info.products + steady.preparation_cost(flow.domain)
        return Labels(state.amplitude, spent, info.converged)

    return jax.lax.map(one, (parameters, reynolds))
