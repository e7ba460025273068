"""Differentiable physics: the loss's gradient runs back through the solver by its adjoint.

L = mean (|y|^2 + goal^2 (lambda . y / Cd)^2) / 2 over a batch, y the slip of the flow that the
network's traction drives; Adam. Um et al. 2020; Thuerey et al. 2021, chapter 5.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.flow.loads import drag
from surrogate.flow.solver import steady
from surrogate.flow.solver.adjoint import Effort, slip_weights
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.solver.tangent import slip_adjoint
from surrogate.training.methods.method import (
    Batch,
    Method,
    adam_that_ends,
    evaluation_cost,
    predict,
    slowed,
)
from surrogate.training.methods.targets import (
    drag_residuals,
    evaluate_by_inversion,
    no_labels,
    one_step_inversion,
    oseen_influence_matrices,
)

FLOW = NewtonSettings(3e-3, 8, 30)
ADJOINT = Effort(0.1, 30)


class Lagged(NamedTuple):
    """Adam's moments; Oseen compliances of the samples, on which physics is lagged."""

    adam: optax.OptState
    compliance: Float[AnyArray, "samples modes modes"]


class Descent(NamedTuple):
    """Of flows that tractions drive: the loss, its gradient in the traction, what it took."""

    gradient: Float[AnyArray, "*samples modes"]
    loss: Float[AnyArray, "*samples"]
    valid: Bool[AnyArray, "*samples"]
    products: Int[AnyArray, "*samples"]

    def asks(self, batch: Batch) -> bool:
        """Every step needs the flows of its own tractions."""
        return True


def differentiable_physics(
    batch: int = 64, learning_rate: float = 1e-2, goal: float = 30.0, slopes: float = 1.0
) -> Method:
    """DP at its best, on lagged physics: a coupled Newton step a visit, till the sample settles.

    The slip is linear about the step's traction a+, ``C (a - a+)`` by Oseen compliances C; settled
    flows tell by one adjoint what the drag's slopes are.
    """
    optimiser = adam_that_ends(learning_rate)

    def init(network, physics):
        lagged = Lagged(optimiser.init(network.weights), oseen_influence_matrices(physics))
        return lagged, no_labels(physics)

    def learn(network, memory, targets, samples, batch, done):
        known = targets.known[batch]

        def loss_of(weights):
            moved = network.with_weights(weights)
            away = predict(moved, samples, batch) - targets.tractions[batch]
            slip = jnp.einsum("bym,bm->by", memory.compliance[batch], away)
            misses = jax.vmap(lambda k: drag_residuals(moved, samples, targets, k))(batch)
            scale = goal * jnp.append(1.0, jnp.full(misses.shape[1] - 1, slopes))
            losses = jnp.sum(slip**2, axis=1) + jnp.sum((scale * misses) ** 2, axis=1)
            return jnp.sum(jnp.where(known, losses, 0.0)) / jnp.maximum(jnp.sum(known), 1) / 2

        loss, gradient = jax.value_and_grad(loss_of)(network.weights)
        network, adam = _step(optimiser, learning_rate, network, memory.adam, gradient, done)
        return network, memory._replace(adam=adam), loss

    return Method(init, evaluate_by_inversion(one_step_inversion(slopes=slopes > 0)), learn, batch)


def published_differentiable_physics(
    batch: int = 4, learning_rate: float = 1e-2, goal: float = 3.0
) -> Method:
    """DP as published: one warm-started forced flow and two adjoints per sample and step."""
    optimiser = adam_that_ends(learning_rate)

    def init(network, physics):
        count, modes = physics.tractions.shape
        none, zeros = jnp.zeros(count, int), jnp.zeros(count)
        blank = Descent(jnp.zeros((count, modes)), zeros, none.astype(bool), none)
        return optimiser.init(network.weights), blank

    def driven(physics, row, velocity, amplitude, oseen):
        domain, operators = physics.domain, physics.operators_of(row)
        velocity, info = steady.forced_flow(domain, operators, amplitude, velocity, FLOW)
        state = FlowState(velocity, amplitude)
        slip = steady.slip_residual(domain, operators, state)
        weights, spent = slip_weights(drag, domain, operators, state, ADJOINT)
        scale = goal / (2 * jnp.abs(oseen[0]))
        miss = scale * (weights @ slip)
        pulled = slip + scale * miss * weights
        gradient, spent_too = slip_adjoint(domain, operators, state, pulled, ADJOINT)
        valid = info.converged & jnp.all(jnp.isfinite(gradient))
        products = info.products + spent.products + spent_too.products + physics.renewal
        told = Descent(gradient, (slip @ slip + miss**2) / 2, valid, products)
        return told, jnp.where(valid, velocity, steady.oseen_velocity(operators, oseen))

    def visit(network, physics, lessons, flows, batch):
        predicted, oseen = predict(network, physics.samples, batch), physics.tractions[batch]
        one = functools.partial(driven, physics)
        told, flows, idle_work = physics.partition.evaluate(batch, flows, one, predicted, oseen)
        lessons = jax.tree.map(lambda old, now: old.at[batch].set(now), lessons, told)
        return lessons, flows, evaluation_cost(told, physics, batch, idle_work)

    def learn(network, adam, lessons, samples, batch, done):
        gradient, loss, valid, _ = jax.tree.map(lambda leaf: leaf[batch], lessons)
        pull = jax.vjp(lambda w: predict(network.with_weights(w), samples, batch), network.weights)
        count = jnp.maximum(jnp.sum(valid), 1)
        gradient = pull[1](jnp.where(valid[:, None], gradient, 0.0) / count)[0]
        network, adam = _step(optimiser, learning_rate, network, adam, gradient, done)
        return network, adam, jnp.sum(jnp.where(valid, loss, 0.0)) / count

    return Method(init, visit, learn, batch)


def _step(optimiser, learning_rate, network, adam, gradient, done):
    change, adam = optimiser.update(gradient, slowed(adam, learning_rate, done))
    return network.with_weights(network.weights + change), adam
