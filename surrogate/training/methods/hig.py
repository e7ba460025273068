"""Half-inverse gradients: the physics Jacobian of a batch, inverted half way.

With J = d(y, goal row)/d(weights) stacked over the batch and scaled by 1/sqrt(B), J = U S V^T,
the update is -eta V S^(-kappa) U^T y / sqrt(B), kappa = 1/2; singular values below tau S_max are
dropped. Schnell, Holl, Thuerey 2022 (Half-Inverse Gradients for Physical Deep Learning).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from surrogate.flow.solver import steady
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.solver.tangent import Effort, compliance
from surrogate.model.network import DragNetwork
from surrogate.training.methods.inverse import partial_inverse, partial_inverse_lanczos
from surrogate.training.methods.method import Batch, Method, Progress, keep, per_sample, predict
from surrogate.training.methods.targets import (
    Targets,
    improve,
    no_targets,
    one_step,
    oseen_compliances,
)
from surrogate.training.physics import Physics

FLOW = NewtonSettings(1e-4, 10, 40)
TANGENT = Effort(1e-2, 30)


class HigState(NamedTuple):
    """Per sample the last flow with its target, and the Oseen compliance; iterations done."""

    targets: Targets
    compliance: Float[Array, "samples modes modes"]
    iteration: Int[Array, ""]


def half_inverse_gradients(
    lagged: bool = True,
    batch: int = 64,
    eta: float = 1.0,
    decay: float = 60.0,
    tau: float = 1e-3,
    kappa: float = 0.5,
    goal: float = 3.0,
    vectors: int | None = None,
) -> Method:
    """HIG on the slip y of a batch and its compliance C = dy/da.

    On ``lagged`` physics both are those of ``targets``, by Oseen compliances; else, as published,
    the flow that the network's traction drives is solved, with one tangent solve per mode. Samples
    whose flow or tangents fail are left out of the step and restart from their Oseen flow.
    ``kappa`` is the exponent of the inversion: 1 Gauss-Newton, -1 gradient descent; ``vectors`` of
    Lanczos invert without ever forming the Jacobian of the weights, as large networks need.
    """

    def init(network, physics):
        return HigState(no_targets(physics), oseen_compliances(physics), jnp.array(0))

    def driven(physics, index, predicted, flow):
        domain, case = physics.domain, physics.case(index)
        velocity, info = steady.forced_flow(domain, case, predicted, flow, FLOW)
        state = FlowState(velocity, predicted)
        slip = steady.slip_residual(domain, case, state)
        matrix, spent = compliance(domain, case, state, TANGENT)
        valid = info.converged & spent.converged
        return slip, velocity, matrix, valid, info.products + spent.products

    def exact(physics, batch, predicted, state):
        slip, flows, matrix, valid, products = per_sample(
            lambda *sample: driven(physics, *sample), batch, predicted, state.targets.flows[batch]
        )
        flows = keep(valid, flows, physics.oseen.velocity[batch])
        targets = state.targets._replace(flows=state.targets.flows.at[batch].set(flows))
        return slip, targets, keep(valid, matrix, state.compliance[batch]), valid, jnp.sum(products)

    def linearised(physics, batch, predicted, state):
        targets, _, products = improve(physics, batch, predicted, state.targets, one_step())
        matrix = state.compliance[batch]
        slip = jnp.einsum("bym,bm->by", matrix, predicted - targets.tractions[batch])
        return slip, targets, matrix, targets.known[batch], products

    def update(network, state, physics, batch, done):
        predicted = predict(network, physics, batch)
        see = linearised if lagged else exact
        slip, targets, matrix, valid, products = see(physics, batch, predicted, state)
        y, physical = with_goal_row(slip, matrix, goal, physics.oseen.amplitude[batch, 0])
        valid &= jnp.all(jnp.isfinite(y), axis=1) & jnp.all(jnp.isfinite(physical), axis=(1, 2))
        y = jnp.where(valid[:, None], y, 0.0)
        physical = jnp.where(valid[:, None, None], physical, 0.0)
        root = jnp.sqrt(jnp.maximum(jnp.sum(valid), 1.0))
        step = weight_step(network, physics, batch, y / root, physical / root, tau, kappa, vectors)
        rate = eta / (1 + state.iteration / decay)
        spent = Progress(products, jnp.sum((y / root) ** 2) / 2, jnp.sum(~valid))
        network = network.with_weights(network.weights - rate * step)
        return network, state._replace(targets=targets, iteration=state.iteration + 1), spent

    return Method(init, update, batch)


def weight_step(
    network: DragNetwork,
    physics: Physics,
    batch: Batch,
    y: Float[Array, "batch outputs"],
    physical: Float[Array, "batch outputs modes"],
    tau: float,
    kappa: float,
    vectors: int | None = None,
) -> Float[Array, " weights"]:
    """The partial inverse of J = dy/da da/dw on y: dense, or by so many Lanczos vectors."""

    def tractions(weights):
        return predict(network.with_weights(weights), physics, batch)

    if vectors is None:
        learned = jax.jacrev(tractions)(network.weights)
        jacobian = jnp.einsum("bym,bmw->byw", physical, learned).reshape(y.size, -1)
        return partial_inverse(jacobian, y.ravel(), tau, kappa)

    tangent = jax.linearize(tractions, network.weights)[1]
    adjoint = jax.linear_transpose(tangent, network.weights)

    def forward(v):
        return jnp.einsum("bym,bm->by", physical, tangent(v)).ravel()

    def transpose(z):
        return adjoint(jnp.einsum("bym,by->bm", physical, z.reshape(y.shape)))[0]

    return partial_inverse_lanczos(forward, transpose, y.ravel(), tau, kappa, vectors)


def with_goal_row(slip, compliance, goal, force):
    """Append the dual-weighted drag error goal * lambda . y / Cd and its derivative in a.

    lambda solves C^T lambda = d(2 a_0)/da, so the row's derivative is known without it.
    """
    row = jnp.zeros_like(slip).at[:, 0].set(goal / jnp.abs(force))
    miss = jnp.einsum("bm,bm->b", row, jnp.linalg.solve(compliance, slip[..., None])[..., 0])
    y = jnp.concatenate([slip, miss[:, None]], axis=1)
    return y, jnp.concatenate([compliance, row[:, None]], axis=1)
