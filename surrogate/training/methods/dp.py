"""Differentiable physics: the loss's gradient runs back through the solver by its adjoint.

L = mean (|y|^2 + goal^2 (lambda . y / Cd)^2) / 2 over a batch, y the slip of the flow that the
network's traction drives; Adam. Um et al. 2020; Thuerey et al. 2021, chapter 5.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int

from surrogate.devices import Owned
from surrogate.flow.solver import steady
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.solver.tangent import Effort, drag_weights, slip_adjoint
from surrogate.training.methods.method import (
    Method,
    Progress,
    adam_that_ends,
    predict,
    slowed,
)
from surrogate.training.methods.targets import (
    Targets,
    drag_misses,
    improve,
    no_targets,
    one_step,
    oseen_compliances,
)

FLOW = NewtonSettings(3e-3, 8, 30)
ADJOINT = Effort(0.1, 30)


class DpState(NamedTuple):
    """Adam's moments; last flows with their targets; Oseen compliances, if physics is lagged."""

    adam: optax.OptState
    targets: Targets
    compliance: Float[Array, "samples modes modes"] | None


class Descent(NamedTuple):
    """Of a flow that a traction drives: the loss, its gradient in the traction, what it took."""

    gradient: Float[Array, " modes"]
    loss: Float[Array, ""]
    valid: Bool[Array, ""]
    products: Int[Array, ""]


def differentiable_physics(
    batch: int = 64, learning_rate: float = 1e-2, goal: float = 30.0, slopes: float = 1.0
) -> Method:
    """DP at its best, on lagged physics: a coupled Newton step a visit, till the sample settles.

    The slip is linear about the step's traction a+, ``C (a - a+)`` by Oseen compliances C; settled
    flows tell by one adjoint what the drag's slopes are.
    """
    optimiser, invert = adam_that_ends(learning_rate), one_step(slopes=slopes > 0)

    def init(network, physics):
        adam = optimiser.init(network.weights)
        return DpState(adam, no_targets(physics), oseen_compliances(physics))

    def update(network, state, physics, batch, done):
        predicted = predict(network, physics, batch)
        targets, spent = improve(physics, batch, predicted, state.targets, invert)
        known = targets.known[batch]

        def loss_of(weights):
            moved = network.with_weights(weights)
            away = predict(moved, physics, batch) - targets.tractions[batch]
            slip = jnp.einsum("bym,bm->by", state.compliance[batch], away)
            misses = jax.vmap(lambda k: drag_misses(moved, physics, targets, k))(batch)
            scale = goal * jnp.append(1.0, jnp.full(misses.shape[1] - 1, slopes))
            losses = jnp.sum(slip**2, axis=1) + jnp.sum((scale * misses) ** 2, axis=1)
            return jnp.sum(jnp.where(known, losses, 0.0)) / jnp.maximum(jnp.sum(known), 1) / 2

        loss, gradient = jax.value_and_grad(loss_of)(network.weights)
        network, adam = _step(optimiser, learning_rate, network, state.adam, gradient, done)
        return network, DpState(adam, targets, state.compliance), spent._replace(loss=loss)

    return Method(init, update, batch)


def published_differentiable_physics(
    batch: int = 4, learning_rate: float = 1e-2, goal: float = 3.0
) -> Method:
    """DP as published: one warm-started forced flow and two adjoints per sample and step."""
    optimiser = adam_that_ends(learning_rate)

    def init(network, physics):
        adam = optimiser.init(network.weights)
        return DpState(adam, no_targets(physics), None)

    def driven(physics, row, velocity, amplitude, reference):
        domain, case = physics.domain, physics.case(row)
        velocity, info = steady.forced_flow(domain, case, amplitude, velocity, FLOW)
        state = FlowState(velocity, amplitude)
        slip = steady.slip_residual(domain, case, state)
        weights, spent = drag_weights(domain, case, state, ADJOINT)
        scale = goal / (2 * jnp.abs(reference[0]))
        miss = scale * (weights @ slip)
        pulled = slip + scale * miss * weights
        gradient, spent_too = slip_adjoint(domain, case, state, pulled, ADJOINT)
        valid = info.converged & jnp.all(jnp.isfinite(gradient))
        products = info.products + spent.products + spent_too.products + physics.renewal
        told = Descent(gradient, (slip @ slip + miss**2) / 2, valid, products)
        return told, jnp.where(valid, velocity, physics.velocities.rows[row])

    def update(network, state, physics, batch, done):
        predicted, pull = jax.vjp(
            lambda w: predict(network.with_weights(w), physics, batch), network.weights
        )
        owned, reference = state.targets.velocities.rows, physics.tractions[batch]
        told, owned, waiting = physics.deal.visit(
            batch, owned, functools.partial(driven, physics), predicted, reference
        )
        targets, valid = state.targets._replace(velocities=Owned(owned)), told.valid
        count = jnp.maximum(jnp.sum(valid), 1)
        gradient = pull(jnp.where(valid[:, None], told.gradient, 0.0) / count)[0]
        network, adam = _step(optimiser, learning_rate, network, state.adam, gradient, done)
        loss = jnp.sum(jnp.where(valid, told.loss, 0.0)) / count
        spent = Progress(jnp.sum(told.products), loss, jnp.sum(~valid), waiting)
        return network, DpState(adam, targets, state.compliance), spent

    return Method(init, update, batch)


def _step(optimiser, learning_rate, network, adam, gradient, done):
    change, adam = optimiser.update(gradient, slowed(adam, learning_rate, done))
    return network.with_weights(network.weights + change), adam
