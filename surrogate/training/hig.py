"""Half-inverse gradients: the physics Jacobian of a batch, inverted half way.

With J = d(y, goal row)/d(weights) stacked over the batch and scaled by 1/sqrt(B), J = U S V^T,
the update is -eta V S^(-kappa) U^T y / sqrt(B), kappa = 1/2; singular values below tau S_max are
dropped. Schnell, Holl, Thuerey 2022 (Half-Inverse Gradients for Physical Deep Learning).
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from surrogate.flow import steady
from surrogate.flow.newton import NewtonSettings
from surrogate.flow.steady import FlowState
from surrogate.flow.tangent import Effort
from surrogate.network import DragNetwork
from surrogate.training.compliance import Kept, kept_compliance, oseen_compliances
from surrogate.training.inverse import partial_inverse, partial_inverse_lanczos
from surrogate.training.method import Batch, Method, Progress, keep, per_sample, predict
from surrogate.training.physics import Physics
from surrogate.training.targets import Fidelity, Targets, improve, inversion, no_targets


class State(NamedTuple):
    """Per sample the last flow with its target, and the kept compliance; iterations done."""

    targets: Targets
    kept: Kept
    iteration: Int[Array, ""]


def half_inverse_gradients(
    fidelity: Fidelity = "lagged",
    batch: int = 64,
    eta: float = 1.0,
    decay: float = 60.0,
    tau: float = 1e-3,
    kappa: float = 0.5,
    goal: float = 3.0,
    lag: float = math.inf,
    settle: float = 1e-4,
    leave_out: bool = True,
    lanczos: int | None = None,
    settings: NewtonSettings = NewtonSettings(1e-4, 10, 40),
    effort: Effort = Effort(1e-2, 30),
) -> Method:
    """HIG on the slip y of a batch and its compliance C = dy/da.

    ``fidelity`` says which slip (``targets``); ``exact`` with ``lag`` 0 is the published method,
    one forced flow and one tangent solve per mode and visit. With a lag, a compliance is solved
    again only where the traction has moved by that much, relatively; infinity keeps the Oseen
    ones. Samples whose flow or tangents fail are left out of the step and restart from their
    Oseen flow (``leave_out``; without it only numbers that are not finite are). ``kappa`` is the
    exponent of the inversion: 1 Gauss-Newton, -1 gradient descent. ``lanczos`` vectors invert
    without ever forming the Jacobian of the weights, as large networks need.
    """

    def init(network, physics):
        return State(no_targets(physics), oseen_compliances(physics), jnp.array(0))

    def driven(physics, index, predicted, flow, kept):
        domain, case = physics.domain, physics.case(index)
        velocity, info = steady.forced_flow(domain, case, predicted, flow, settings)
        state = FlowState(velocity, predicted)
        slip = steady.slip_residual(domain, case, state)
        kept, spent = kept_compliance(domain, case, state, kept, lag, effort)
        valid = info.converged & spent.converged | (not leave_out)
        return slip, velocity, kept, valid, info.products + spent.products

    def exact(physics, batch, predicted, state):
        start, kept = state.targets.flows[batch], pick(state.kept, batch)
        slip, flows, new, valid, products = per_sample(
            lambda *sample: driven(physics, *sample), batch, predicted, start, kept
        )
        flows = keep(valid, flows, physics.oseen.velocity[batch])
        targets = state.targets._replace(flows=state.targets.flows.at[batch].set(flows))
        return slip, targets, keep(valid, new, kept), valid, jnp.sum(products)

    def linearised(physics, batch, predicted, state):
        invert = inversion("frozen" if fidelity == "frozen" else "lagged", settle, effort)
        targets, _, products = improve(physics, batch, predicted, state.targets, invert)
        inverted = FlowState(targets.flows[batch], targets.tractions[batch])

        def update(index, flow, kept):
            return kept_compliance(physics.domain, physics.case(index), flow, kept, lag, effort)

        old = pick(state.kept, batch)
        new, spent = per_sample(update, batch, inverted, old)
        kept = keep(spent.converged, new, old)
        slip = jnp.einsum("bym,bm->by", kept.matrix, predicted - inverted.amplitude)
        valid = targets.known[batch] & spent.converged
        return slip, targets, kept, valid, products + jnp.sum(spent.products)

    def update(network, state, physics, batch, done):
        predicted = predict(network, physics, batch)
        see = exact if fidelity == "exact" else linearised
        slip, targets, kept, valid, products = see(physics, batch, predicted, state)
        y, physical = with_goal_row(slip, kept.matrix, goal, physics.oseen.amplitude[batch, 0])
        valid &= jnp.all(jnp.isfinite(y), axis=1) & jnp.all(jnp.isfinite(physical), axis=(1, 2))
        y = jnp.where(valid[:, None], y, 0.0)
        physical = jnp.where(valid[:, None, None], physical, 0.0)
        root = jnp.sqrt(jnp.maximum(jnp.sum(valid), 1.0))
        step = weight_step(network, physics, batch, y / root, physical / root, tau, kappa, lanczos)
        rate = eta / (1 + state.iteration / decay)
        all_kept = jax.tree.map(lambda old, new: old.at[batch].set(new), state.kept, kept)
        spent = Progress(products, jnp.sum((y / root) ** 2) / 2, jnp.sum(~valid))
        network = network.with_weights(network.weights - rate * step)
        return network, State(targets, all_kept, state.iteration + 1), spent

    return Method(init, update, batch)


def weight_step(
    network: DragNetwork,
    physics: Physics,
    batch: Batch,
    y: Float[Array, "batch outputs"],
    physical: Float[Array, "batch outputs modes"],
    tau: float,
    kappa: float,
    lanczos: int | None = None,
) -> Float[Array, " weights"]:
    """The partial inverse of J = dy/da da/dw on y: dense, or by so many Lanczos vectors."""

    def tractions(weights):
        return predict(network.with_weights(weights), physics, batch)

    if lanczos is None:
        learned = jax.jacrev(tractions)(network.weights)
        jacobian = jnp.einsum("bym,bmw->byw", physical, learned).reshape(y.size, -1)
        return partial_inverse(jacobian, y.ravel(), tau, kappa)

    tangent = jax.linearize(tractions, network.weights)[1]
    adjoint = jax.linear_transpose(tangent, network.weights)

    def forward(v):
        return jnp.einsum("bym,bm->by", physical, tangent(v)).ravel()

    def transpose(z):
        return adjoint(jnp.einsum("bym,by->bm", physical, z.reshape(y.shape)))[0]

    return partial_inverse_lanczos(forward, transpose, y.ravel(), tau, kappa, lanczos)


def pick(tree, batch):
    """The samples of a batch."""
    return jax.tree.map(lambda leaf: leaf[batch], tree)


def with_goal_row(slip, compliance, goal, force):
    """Append the dual-weighted drag error goal * lambda . y / Cd and its derivative in a.

    lambda solves C^T lambda = d(2 a_0)/da, so the row's derivative is known without it.
    """
    row = jnp.zeros_like(slip).at[:, 0].set(goal / jnp.abs(force))
    miss = jnp.einsum("bm,bm->b", row, jnp.linalg.solve(compliance, slip[..., None])[..., 0])
    y = jnp.concatenate([slip, miss[:, None]], axis=1)
    return y, jnp.concatenate([compliance, row[:, None]], axis=1)
