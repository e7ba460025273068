"""Half-inverse gradients: the Jacobian of a batch's outcomes in the weights, inverted half way.

With J = d(outcomes)/d(weights) stacked over the batch and scaled by 1/sqrt(B), J = U S V^T, the
update is -eta V S^(-kappa) U^T y / sqrt(B), kappa = 1/2; singular values below tau S_max are
dropped. Schnell, Holl, Thuerey 2022 (Half-Inverse Gradients for Physical Deep LearnerState).

As published the outcomes are the slips of the flows that the network's tractions drive. At its best
they are what a solved flow and its adjoint tell: log Cd and its slopes in shape and Re.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.flow.solver import steady
from surrogate.flow.solver.adjoint import Effort
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.solver.tangent import slip_jacobian
from surrogate.training.methods.inverse import partial_inverse, partial_inverse_lanczos
from surrogate.training.methods.method import Batch, Method, evaluation_cost, predict
from surrogate.training.methods.targets import (
    drag_residuals,
    evaluate_by_inversion,
    full_inversion,
    no_labels,
)

FLOW = NewtonSettings(1e-4, 10, 40)
TANGENT = Effort(1e-2, 30)

Weights = Float[Array, " weights"]
Outcomes = Callable[[Weights, Int[Array, ""]], Float[Array, " outcomes"]]  # of one sample


class Driven(NamedTuple):
    """Of a flow that a traction drives: its slip, the compliance, and what it took."""

    slip: Float[Array, " modes"]
    matrix: Float[Array, "modes modes"]
    valid: Bool[Array, ""]
    products: Int[Array, ""]


class Linearised(NamedTuple):
    """Last slips of all samples, the goal's row among them, and their derivatives in the tractions.

    All nought for samples that are left out.
    """

    y: Float[AnyArray, "samples outcomes"]
    physical: Float[AnyArray, "samples outcomes modes"]

    def asks(self, batch: Batch) -> bool:
        """Every step needs the flows of its own tractions."""
        return True


def half_inverse_gradients(
    batch: int = 1024,
    eta: float = 1.0,
    decay: float = 120.0,
    tau: float = 1e-5,
    kappa: float = 0.5,
    vectors: int | None = None,
) -> Method:
    """HIG at its best: every sample's flow and adjoint are solved once, at the first visit.

    The step is ``eta / (1 + iteration / decay)`` of the inverse; ``kappa`` 1 is Gauss-Newton, -1
    gradient descent; so many Lanczos ``vectors`` invert without ever forming the Jacobian, as large
    networks need.
    """

    def init(network, physics):
        return jnp.array(0), no_labels(physics)

    def learn(network, iteration, targets, samples, batch, done):
        def outcomes(weights, index):
            return drag_residuals(network.with_drag_weights(weights), samples, targets, index)

        weights = network.drag_weights
        y = jax.vmap(outcomes, (None, 0))(weights, batch)
        step = weight_step(outcomes, weights, batch, y, tau, kappa, vectors)
        rate = eta / (1 + iteration / decay)
        network = network.with_drag_weights(weights - rate * step)
        return network, iteration + 1, jnp.mean(jnp.sum(y**2, axis=1)) / 2

    return Method(init, evaluate_by_inversion(full_inversion(slopes=True)), learn, batch)


def published_half_inverse_gradients(
    batch: int = 32,
    eta: float = 1.0,
    decay: float = 60.0,
    tau: float = 1e-3,
    kappa: float = 0.5,
    goal: float = 3.0,
) -> Method:
    """HIG as published: one driven flow per sample and step, one tangent solve per mode.

    The weighted drag error ``goal * lambda . y / Cd`` is one more row. Samples whose flow or
    tangents fail are left out of the step and restart from their Oseen flow.
    """

    def init(network, physics):
        count, modes = physics.tractions.shape
        blank = jnp.zeros((count, modes + 1)), jnp.zeros((count, modes + 1, modes))
        return jnp.array(0), Linearised(*blank)

    def driven(physics, row, velocity, predicted, oseen):
        domain, operators = physics.domain, physics.operators_of(row)
        velocity, info = steady.forced_flow(domain, operators, predicted, velocity, FLOW)
        state = FlowState(velocity, predicted)
        slip = steady.slip_residual(domain, operators, state)
        matrix, spent = slip_jacobian(domain, operators, state, TANGENT)
        valid = info.converged & spent.converged
        told = Driven(slip, matrix, valid, info.products + spent.products + physics.renewal)
        return told, jnp.where(valid, velocity, steady.oseen_velocity(operators, oseen))

    def visit(network, physics, lessons, flows, batch):
        predicted, oseen = predict(network, physics.samples, batch), physics.tractions[batch]
        one = functools.partial(driven, physics)
        told, flows, idle_work = physics.partition.evaluate(batch, flows, one, predicted, oseen)
        y, physical = with_goal_row(told.slip, told.matrix, goal, oseen[:, 0])
        finite = jnp.all(jnp.isfinite(y), axis=1) & jnp.all(jnp.isfinite(physical), axis=(1, 2))
        told = told._replace(valid=told.valid & finite)
        y = jnp.where(told.valid[:, None], y, 0.0)
        physical = jnp.where(told.valid[:, None, None], physical, 0.0)
        lessons = Linearised(lessons.y.at[batch].set(y), lessons.physical.at[batch].set(physical))
        return lessons, flows, evaluation_cost(told, physics, batch, idle_work)

    def learn(network, iteration, lessons, samples, batch, done):
        y = lessons.y[batch]

        def outcomes(weights, index):
            sample = jax.tree.map(lambda part: part[index], samples)
            return lessons.physical[index] @ network.with_weights(weights)(*sample)

        step = weight_step(outcomes, network.weights, batch, y, tau, kappa)
        rate = eta / (1 + iteration / decay)
        loss = jnp.sum(y**2) / jnp.maximum(jnp.sum(jnp.any(y != 0, axis=1)), 1) / 2
        return network.with_weights(network.weights - rate * step), iteration + 1, loss

    return Method(init, visit, learn, batch)


def weight_step(
    outcomes: Outcomes,
    weights: Weights,
    batch: Batch,
    y: Float[Array, "batch outcomes"],
    tau: float,
    kappa: float,
    vectors: int | None = None,
) -> Weights:
    """The partial inverse of the batch's J on y: dense, or by so many Lanczos vectors.

    Samples that are left out have outcomes of nought and count for nothing.
    """
    root = jnp.sqrt(jnp.maximum(jnp.sum(jnp.any(y != 0, axis=1)), 1))
    y = y / root
    if vectors is None:
        rows = jax.vmap(jax.jacrev(outcomes), (None, 0))(weights, batch) / root
        rows = rows.reshape(y.size, -1)
        return partial_inverse(rows, y.ravel(), tau, kappa)

    forward = jax.linearize(lambda w: jax.vmap(outcomes, (None, 0))(w, batch) / root, weights)[1]
    adjoint = jax.linear_transpose(forward, weights)
    return partial_inverse_lanczos(
        lambda v: forward(v).ravel(),
        lambda z: adjoint(z.reshape(y.shape))[0],
        y.ravel(),
        tau,
        kappa,
        vectors,
    )


def with_goal_row(slip, compliance, goal, force):
    """Append the dual-weighted drag error goal * lambda . y / Cd and its derivative in a.

    lambda solves C^T lambda = d(2 a_0)/da, so the row's derivative is known without it.
    """
    row = jnp.zeros_like(slip).at[:, 0].set(goal / jnp.abs(force))
    miss = jnp.einsum("bm,bm->b", row, jnp.linalg.solve(compliance, slip[..., None])[..., 0])
    y = jnp.concatenate([slip, miss[:, None]], axis=1)
    return y, jnp.concatenate([compliance, row[:, None]], axis=1)
