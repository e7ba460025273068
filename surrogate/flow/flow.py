"""``Flow``: drags, gradients and whole solutions of the steady flow past a scene's bodies."""

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import Bodies, Body, Number, Numbers
from surrogate.body.contour import naca4
from surrogate.body.shape import Shape, contour_shape, family_shape
from surrogate.checks import expect, flag, one_body, traced, transformed
from surrogate.devices import Devices, choose_devices
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.batch import FlowBatch, batch_solver, estimated_cost
from surrogate.flow.continuation import not_converged_message
from surrogate.flow.coverage import check_steady, checked, checked_numbers, covers
from surrogate.flow.derivatives import (
    LoadsAndGradients,
    loads_and_gradients,
    loads_and_status,
)
from surrogate.flow.discrete import DiscreteBodies
from surrogate.flow.grid.discretise import fitted_domain, scene_domain
from surrogate.flow.grid.domain import Domain
from surrogate.flow.loads import LOADS, Load, drag
from surrogate.flow.solution import Solution
from surrogate.flow.solve_shape import solve_shape, with_estimate
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.partition import partition_bodies
from surrogate.scene.limits import check_reynolds, onset_of
from surrogate.scene.scene import Scene


@dataclasses.dataclass(frozen=True)
class Flow:
    """The steady laminar flow past the bodies of a scene, solved on one grid and compiled once.

    A body is an array of the parameters of the scene's family, in the order of
    ``scene.family.names``. ``drag`` works under jax.jit, jax.vmap, jax.grad and jax.jvp; ``solve``
    returns everything that is known of one flow, and also takes any ``Shape`` (a contour, a NACA
    section, a body at incidence), on a grid that fits it.

    Args:
      scene: what is modelled.
      settings: tolerances of the Newton solver.

    Raises:
      InvalidInput: the scene is not a ``Scene``.
    """

    scene: Scene
    settings: NewtonSettings = NewtonSettings()

    def __post_init__(self):
        expect("flow", self.scene, Scene, "Scene")
        expect("flow", self.settings, NewtonSettings, "NewtonSettings")

    def __str__(self) -> str:
        return f"flow in {self.scene}"

    @functools.cached_property
    def domain(self) -> Domain:
        """The discretisation of the scene, which holds all of its bodies."""
        return scene_domain(self.scene)

    @functools.cached_property
    def bodies(self) -> DiscreteBodies:
        """The scene's class of bodies on its grid: all that compiled programs depend on."""
        return DiscreteBodies(self.domain, self.scene.family.body_class, self.settings)

    def drag(
        self, parameters: Body, reynolds: Number, *, allow_unsteady: bool = False
    ) -> Float[Array, ""]:
        """Return the drag coefficient Cd of a family body at Re = U D / nu.

        Cd is 2 Fx per unit span in 2-D and 8 Fx / pi in 3-D, with U = D = rho = 1. It can be
        differentiated once in both arguments, in forward and in reverse mode, by one adjoint.
        Under a transformation of JAX the result is NaN where the eager call would raise.

        Args:
          parameters: of the body, shape (parameters,).
          reynolds: Reynolds number.
          allow_unsteady: answer beyond the onset of instability too.

        Raises:
          InvalidInput: there is no such body or Reynolds number, or the scene's grid does not
            cover it.
          NotConverged: the solver did not converge.
        """
        return self._loads((drag,), parameters, reynolds, allow_unsteady)[0]

    def loads(
        self, parameters: Body, reynolds: Number, *, allow_unsteady: bool = False
    ) -> Float[Array, "3"]:
        """Return Cd, Cl and Cm of a family body at Re = U D / nu, as an array.

        As ``drag``, with the lift across the stream and the moment M about the centroid, nose up:
        in 2-D Cl = 2 Fy and Cm = 2 M per unit span, in 3-D Cl = 8 Fz / pi and Cm = 8 M / pi.
        ``jax.jacobian`` takes one adjoint for each of them. Bodies that are symmetric about the
        stream have Cl = Cm = 0, at no cost.

        Args:
          parameters: of the body, shape (parameters,).
          reynolds: Reynolds number.
          allow_unsteady: answer beyond the onset of instability too.

        Raises:
          InvalidInput: as ``drag``.
          NotConverged: the solver did not converge.
        """
        return self._loads(tuple(LOADS.values()), parameters, reynolds, allow_unsteady)

    def _loads(self, loads: tuple[Load, ...], parameters, reynolds, allow_unsteady):
        at = self._one_body(parameters, reynolds, allow_unsteady)
        values, info = loads_and_status(self.bodies, loads, *at)
        if traced(values):
            covered = covers(self.scene, self.bodies, *at, allow_unsteady)
            known = info.converged & covered
            return values * jnp.where(known, 1.0, jnp.nan)  # so are their gradients
        if not bool(info.converged):
            raise NotConverged(not_converged_message(float(at[1]), info))
        return values

    def loads_and_gradients(
        self,
        parameters: Body,
        reynolds: Number,
        *,
        allow_unsteady: bool = False,
        partial: bool = False,
    ) -> LoadsAndGradients:
        """Return the loads of a body and their gradients, cheaper than by ``jax.grad``.

        Each load takes an adjoint, which is solved to a relative residual of 2e-4 (Cd) or
        7e-4 (Cl, Cm).

        Args:
          parameters: of the body, shape (parameters,).
          reynolds: Reynolds number.
          allow_unsteady: answer beyond the onset of instability too.
          partial: return where the flow or an adjoint did not converge, too: the loads and
            gradients are NaN then, and ``converged`` is false.

        Raises:
          InvalidInput: as ``drag``.
          NotConverged: the flow or an adjoint did not converge, unless ``partial``.
        """
        at = self._one_body(parameters, reynolds, allow_unsteady)
        partial = flag("partial", partial)
        found = loads_and_gradients(self.bodies, *at)
        if not traced(found.loads):
            if not partial and not bool(found.converged):
                raise NotConverged(
                    f"flow or adjoint at Re {float(at[1]):g} did not converge; flow.solve "
                    "reaches it by continuation in Re, partial=True returns NaN"
                )
            return found
        known = covers(self.scene, self.bodies, *at, allow_unsteady)
        parts = (jnp.where(known, part, jnp.nan) for part in found[:3])
        return LoadsAndGradients(*parts, found.green_applications, found.converged & known)

    def solve(
        self,
        body: Shape | Body | str,
        reynolds: Number,
        *,
        gradient: bool = False,
        estimate: bool = True,
        allow_unsteady: bool = False,
    ) -> Solution:
        """Solve the flow past one body: force coefficients, fields, work and estimated error.

        Args:
          body: parameters of the scene's family, solved on the scene's grid; or a ``Shape``,
            solved on a grid that fits it, in the scene's stream at the scene's fidelity; the name
            of a NACA section, as "naca 0012", is one at zero incidence.
          reynolds: U D / nu.
          gradient: compute the loads' derivatives by parameters and Re as well (family bodies).
          estimate: estimate the error, at two thirds of the flow's cost.
          allow_unsteady: answer beyond the onset of instability too.

        Raises:
          InvalidInput: there is no such body or Reynolds number, or they do not fit the grid or
            the stream.
          NotConverged: the flow, or the adjoint that the gradient needs, did not converge.
        """
        gradient, estimate = flag("gradient", gradient), flag("estimate", estimate)
        allow_unsteady = flag("allow_unsteady", allow_unsteady)
        if isinstance(body, str):
            body = contour_shape(naca4(body))
        if isinstance(body, Shape):
            body = body.differentiable() if gradient else body
            on_grid = self._on_its_own_grid(body, reynolds, allow_unsteady)
        else:
            on_grid = self._on_scenes_grid(body, reynolds, allow_unsteady)
        found = solve_shape(self.scene, self.settings, *on_grid, gradient)
        return self.estimated(found) if estimate else found

    def estimated(self, solution: Solution) -> Solution:
        """Return a solution of this flow with an estimate of its error, as ``solve`` adds it."""
        return with_estimate(self.scene, self.settings, solution)

    def solve_all(
        self,
        parameters: Bodies,
        reynolds: Numbers,
        devices: Devices | int | None = None,
        *,
        gradients: bool = False,
        allow_unsteady: bool = False,
        partial: bool = False,
    ) -> FlowBatch | LoadsAndGradients:
        """Solve the flows past many family bodies, partitioned over devices.

        Another number of bodies is compiled anew.

        Args:
          parameters: of the bodies, shape (bodies, parameters).
          reynolds: Reynolds numbers, shape (bodies,), or one for all bodies.
          devices: over which the bodies are partitioned, or how many; by default one.
          gradients: return the loads with their gradients, as ``loads_and_gradients``.
          allow_unsteady: answer beyond the onset of instability too.
          partial: return where some flows did not converge, too; ``converged`` says which did.

        Raises:
          InvalidInput: one is no body, or no Reynolds number of the scene, or its steady flow is
            unstable and ``allow_unsteady`` is not set.
          NotConverged: a flow did not converge, unless ``partial``.
        """
        gradients, partial = flag("gradients", gradients), flag("partial", partial)
        allow_unsteady = flag("allow_unsteady", allow_unsteady)
        parameters = self.scene.family.check_all(parameters)
        reynolds = checked_numbers(self.scene, self.bodies, reynolds, len(parameters))
        onset = self.bodies.check(parameters).onset
        if not allow_unsteady:
            check_steady(reynolds, onset, self.scene.dimension)
        if not isinstance(devices, Devices):
            devices = choose_devices(devices)
        partition = partition_bodies(
            devices, estimated_cost(self.scene.family, parameters, reynolds)
        )
        solve = batch_solver(self.bodies, gradients)
        found = solve(*devices.place((partition, parameters, reynolds)))
        found = jax.tree.map(np.asarray, found)
        if not partial and (missing := int(np.sum(~found.converged))):
            raise NotConverged(f"{missing} of {len(found.converged)} flows did not converge")
        return found

    def _on_its_own_grid(self, shape, reynolds, allow_unsteady):
        """Return a shape and its Re, checked, with a domain that fits it and its fidelity."""
        if shape.dimension != self.scene.dimension:
            raise InvalidInput(
                f"body: of dimension {shape.dimension}, in a scene of {self.scene.dimension}"
            )
        onset = math.inf if allow_unsteady else onset_of(shape)
        reynolds = check_reynolds(reynolds, self.scene.dimension, onset)
        fidelity = self.scene.fidelity.for_body(reynolds, shape.height, shape.nose)
        domain = fitted_domain(self.scene.stream, self.scene.fidelity, shape, reynolds)
        return shape, reynolds, domain, fidelity

    def _on_scenes_grid(self, body, reynolds, allow_unsteady):
        """Return a family body as a shape and its Re, checked, with the scene's domain."""
        parameters, reynolds = self._checked(body, reynolds, allow_unsteady)
        named = self.scene.family.named(parameters)
        shape = family_shape(named, dimension=self.scene.dimension)
        if self.scene.family.has_lift:
            # as the domain is, also where camber and incidence are 0
            shape = shape.differentiable()
        return shape, reynolds, self.domain, self.scene.fidelity_for_bodies

    def _one_body(self, parameters, reynolds, allow_unsteady):
        """Return a body and Re as arrays, checked; in a transformation of JAX by shape alone."""
        parameters = self.scene.family.array(parameters)
        allow_unsteady = flag("allow_unsteady", allow_unsteady)
        if transformed(parameters, reynolds):
            one_body(parameters, reynolds, len(self.scene.family.names))
        else:
            parameters, reynolds = self._checked(parameters, reynolds, allow_unsteady)
        return jnp.asarray(parameters, float), jnp.asarray(reynolds, float)

    def _checked(self, parameters, reynolds, allow_unsteady):
        """Return a body and Re as numbers, refusing what the scene's grid does not cover."""
        return checked(self.scene, self.bodies, parameters, reynolds, allow_unsteady)
