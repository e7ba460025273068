"""The flow as a drag model: the one way to solve a body."""

import dataclasses
import functools
import time

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray, Body, Number
from surrogate.body.outline import MIN_THICKNESS_RATIO, opening
from surrogate.body.shape import Shape, family_shape
from surrogate.checks import expect, one_body, traced
from surrogate.devices import Devices, choose_devices, partition_bodies
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.check.error_estimate import ErrorEstimate, Forces, estimate_error
from surrogate.flow.grid.domain import Domain, fitted_domain, scene_domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.loads.forces import lift_coefficient
from surrogate.flow.solution import Solution
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.steps import (
    DragGradient,
    FlowBatch,
    batch_solver,
    drag_and_slope,
    drag_and_status,
    estimated_cost,
    gradient_at,
    loads,
    not_converged_message,
    solve_by_continuation,
)
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.limits import REYNOLDS, check_reynolds, onset_of_shedding
from surrogate.scene.scene import Scene


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
        expect("flow", self.settings, NewtonSettings, "NewtonSettings")

    @functools.cached_property
    def domain(self) -> Domain:
        """The scene's discretisation."""
        return scene_domain(self.scene)

    def markers(self, parameters: Float[AnyArray, " parameters"]) -> Markers:
        """Contour of a family body as the scene's grid takes it; in space its skin."""
        return self.scene.family.markers(parameters, self.domain.nodes)

    def drag(
        self,
        parameters: Body,
        reynolds: Number,
        allow_unsteady: bool = False,
    ) -> Float[Array, ""]:
        """Cd = 2 Fx per unit span, in space 8 Fx / pi, of a family body.

        For jit, vmap and jax.grad in both arguments. Under a transformation, what cannot be
        answered is NaN.

        Raises:
          InvalidInput: no such body or Reynolds number, or beyond what the scene's grid is for.
          NotConverged: the flow was not found.
        """
        if not traced(parameters, reynolds):
            parameters, reynolds = self._checked(parameters, reynolds, allow_unsteady)
        else:
            one_body(parameters, reynolds, len(self.scene.family.names))
        re = jnp.asarray(reynolds, float)
        cd, info = drag_and_status(self, jnp.asarray(parameters, float), re)
        if traced(parameters, reynolds):
            known = info.converged & self._answers(parameters, re, allow_unsteady)
            return cd * jnp.where(known, 1.0, jnp.nan)  # so is its gradient
        if not bool(info.converged):
            raise NotConverged(not_converged_message(float(reynolds), info))
        return cd

    def slope(self, parameters: Body, reynolds: Number) -> DragGradient:
        """Drag and shape gradient by one adjoint of few digits, cheaper than ``jax.grad``.

        Raises:
          InvalidInput: as ``drag``, but for Reynolds numbers beyond the onset of shedding.
        """
        if not traced(parameters, reynolds):
            parameters, reynolds = self._checked(parameters, reynolds, True)
        return drag_and_slope(self, jnp.asarray(parameters, float), jnp.asarray(reynolds, float))

    def labels(
        self,
        parameters: Float[AnyArray, "bodies parameters"],
        reynolds: Float[AnyArray, " bodies"],
        devices: Devices | None = None,
    ) -> FlowBatch:
        """Flows of many bodies, spread over ``devices``: what trainings are tested by.

        Raises:
          InvalidInput: one is no body, or no Reynolds number of the scene.
          NotConverged: a flow was not found.
        """
        found = self._all(parameters, reynolds, devices, slopes=False)
        if missing := int(np.sum(~found.converged)):
            raise NotConverged(f"{missing} of {len(found.converged)} flows did not converge")
        return found

    def slopes(
        self,
        parameters: Float[AnyArray, "bodies parameters"],
        reynolds: Float[AnyArray, " bodies"],
        devices: Devices | None = None,
    ) -> DragGradient:
        """``slope`` of many bodies, spread over ``devices``."""
        return self._all(parameters, reynolds, devices, slopes=True)

    def _all(self, parameters, reynolds, devices, slopes):
        parameters = self.scene.family.check_all(parameters)
        reynolds = np.asarray(reynolds, float)
        if reynolds.shape != parameters.shape[:1]:
            raise InvalidInput(f"{len(parameters)} bodies, Reynolds numbers {reynolds.shape}")
        for extreme in (reynolds.min(), reynolds.max()) if reynolds.size else ():
            self._check_reynolds(extreme, True)
        if np.any(_reaches(self, parameters) > self.domain.reach):
            raise InvalidInput(
                "bodies: one reaches beyond those that the scene's grid was made for"
            )
        devices = devices or choose_devices()
        partition = partition_bodies(devices, estimated_cost(parameters, reynolds))
        found = batch_solver(self, devices, slopes)(
            *devices.place((partition, parameters, reynolds))
        )
        return jax.tree.map(np.asarray, found)

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
            self._same_dimension(body)
            reynolds = check_reynolds(reynolds, allow_unsteady, self.scene.dimension, body.reach)
            shape, domain = body, _fit(self.scene, body, self.scene.fidelity, reynolds)
        else:
            parameters, reynolds = self._checked(body, reynolds, allow_unsteady)
            named = self.scene.family.named(parameters)
            shape, domain = family_shape(named, dimension=self.scene.dimension), self.domain
        if gradient and (shape.parameters is None or not shape.symmetric):
            raise InvalidInput("gradient: is for bodies of the family at zero incidence")
        start = time.perf_counter()
        found, work = solve_by_continuation(domain, self.settings, shape, reynolds)
        seconds = time.perf_counter() - start
        force = loads(domain, shape.markers(domain.nodes), found.state, reynolds)
        force = {name: float(value) for name, value in force._asdict().items()}
        slopes = gradient_at(domain, self.settings, shape, reynolds, found) if gradient else None
        forces = Forces(force["drag"], force["lift"])
        trust = self._judged(forces, shape, reynolds) if estimate else ErrorEstimate()
        return Solution(
            reynolds=reynolds,
            **force,
            **trust._asdict(),
            green_applications=work,
            newton_steps=int(found.info.steps),
            seconds=seconds,
            gradient=slopes,
            shape=shape,
            domain=domain,
            state=found.state,
        )

    def _judged(self, forces: Forces, shape: Shape, reynolds: float) -> ErrorEstimate:
        def solve(fidelity: Fidelity) -> Forces:
            domain = _fit(self.scene, shape, fidelity, reynolds)
            found, _ = solve_by_continuation(domain, self.settings, shape, reynolds)
            return Forces(found.drag, float(lift_coefficient(domain.modes, found.state.amplitude)))

        height = float(shape.reach[1:].max())
        return estimate_error(forces, solve, self.scene.fidelity, reynolds, height, shape.dimension)

    def _reach(self, parameters):
        """Largest |x|, |y|, ... of a body."""
        points = jax.tree.leaves(self.markers(parameters))[0]
        return jnp.abs(points).max(axis=0)

    def _same_dimension(self, shape):
        if shape.dimension != self.scene.dimension:
            raise InvalidInput(
                f"body: of dimension {shape.dimension}, in a scene of {self.scene.dimension}"
            )

    def _answers(self, parameters, reynolds, allow_unsteady):
        """What ``_checked`` asks of numbers, of traced ones."""
        reach = self._reach(parameters)
        onset = jnp.inf if allow_unsteady else onset_of_shedding(reach)
        highest = jnp.minimum(self.scene.reynolds[1], onset)
        body = opening(parameters, self.scene.family.form) >= MIN_THICKNESS_RATIO
        body &= jnp.all(reach <= self.domain.reach)
        return (
            body
            & (reynolds >= REYNOLDS[self.scene.dimension][0])
            & (reynolds <= highest * (1 + 1e-9))
        )

    def _checked(self, parameters, reynolds, allow_unsteady):
        """Body and Re as numbers that the scene's grid can take."""
        body = self.scene.family.check(parameters)
        reach = self._reach(body)
        value = self._check_reynolds(reynolds, allow_unsteady, reach)
        if np.any(reach > self.domain.reach):
            raise InvalidInput("body: reaches beyond the bodies that the scene's grid was made for")
        return body, value

    def _check_reynolds(self, reynolds, allow_unsteady, reach=None):
        value = check_reynolds(reynolds, allow_unsteady, self.scene.dimension, reach)
        highest = self.scene.reynolds[1]
        if value > highest * (1 + 1e-9):
            raise InvalidInput(
                f"Reynolds number {value:g}: the scene's window is made for wakes up to Re "
                f"{highest:g}; a Scene that reaches further would do"
            )
        return value


@functools.partial(jax.jit, static_argnums=0)
def _reaches(flow: Flow, parameters: Float[Array, "bodies parameters"]) -> Float[Array, "bodies _"]:
    return jax.vmap(flow._reach)(parameters)


def _fit(scene: Scene, shape: Shape, fidelity: Fidelity, reynolds: float) -> Domain:
    return fitted_domain(scene.stream, fidelity, shape, reynolds)
