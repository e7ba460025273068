"""Differentiable physics: the loss's gradient runs back through the solver by its adjoint.

L = mean (|y|^2 + goal^2 (lambda . y / Cd)^2) / 2 over a batch, y the slip of the flow that the
network's traction drives; Adam. Um et al. 2020; Thuerey et al. 2021, chapter 5.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax

from surrogate.flow import steady
from surrogate.flow.newton import NewtonSettings
from surrogate.flow.steady import FlowState
from surrogate.flow.tangent import Effort, drag_weights, slip_adjoint
from surrogate.training.compliance import Kept, oseen_compliances
from surrogate.training.method import Method, Progress, keep, per_sample, predict
from surrogate.training.targets import Fidelity, Targets, improve, inversion, no_targets


class State(NamedTuple):
    """Adam's moments; the last flow of every sample with its target, and Oseen compliances."""

    adam: optax.OptState
    targets: Targets
    kept: Kept


def differentiable_physics(
    fidelity: Fidelity = "exact",
    batch: int = 4,
    learning_rate: float = 1e-2,
    goal: float = 3.0,
    settings: NewtonSettings = NewtonSettings(3e-3, 8, 30),
    effort: Effort = Effort(0.1, 30),
) -> Method:
    """DP: one warm-started forced flow and two adjoints per sample and step.

    That is ``fidelity`` exact; the others take the slip from ``targets`` and Oseen compliances.
    """
    optimiser = optax.inject_hyperparams(optax.adam)(learning_rate)

    def init(network, physics):
        adam = optimiser.init(network.weights)
        return State(adam, no_targets(physics), oseen_compliances(physics))

    def driven(physics, index, amplitude, flow):
        domain, case = physics.domain, physics.case(index)
        velocity, info = steady.forced_flow(domain, case, amplitude, flow, settings)
        state = FlowState(velocity, amplitude)
        slip = steady.slip_residual(domain, case, state)
        weights, spent = drag_weights(domain, case, state, effort)
        row = goal / (2 * jnp.abs(physics.oseen.amplitude[index, 0]))
        miss = row * (weights @ slip)
        pulled = slip + row * miss * weights
        gradient, spent_too = slip_adjoint(domain, case, state, pulled, effort)
        valid = info.converged & jnp.all(jnp.isfinite(gradient))
        products = info.products + spent.products + spent_too.products
        return gradient, velocity, (slip @ slip + miss**2) / 2, valid, products

    def exact(physics, batch, predicted, state):
        flows = state.targets.flows
        gradients, new, losses, valid, products = per_sample(
            lambda *sample: driven(physics, *sample), batch, predicted, flows[batch]
        )
        new = keep(valid, new, physics.oseen.velocity[batch])
        targets = state.targets._replace(flows=flows.at[batch].set(new))
        return gradients, losses, targets, valid, jnp.sum(products)

    def linearised(physics, batch, predicted, state):
        invert = inversion("frozen" if fidelity == "frozen" else "lagged")
        targets, _, products = improve(physics, batch, predicted, state.targets, invert)
        away = predicted - targets.tractions[batch]
        slip = jnp.einsum("bym,bm->by", state.kept.matrix[batch], away)
        row = goal / jnp.abs(physics.oseen.amplitude[batch, 0])
        gradients = jnp.einsum("bym,by->bm", state.kept.matrix[batch], slip)
        gradients = gradients.at[:, 0].add(row**2 * away[:, 0])
        losses = (jnp.sum(slip**2, axis=1) + (row * away[:, 0]) ** 2) / 2
        return gradients, losses, targets, targets.known[batch], products

    def update(network, state, physics, batch, done):
        predicted, pull = jax.vjp(
            lambda w: predict(network.with_weights(w), physics, batch), network.weights
        )
        see = exact if fidelity == "exact" else linearised
        gradients, losses, targets, valid, products = see(physics, batch, predicted, state)
        count = jnp.maximum(jnp.sum(valid), 1)
        gradient = pull(jnp.where(valid[:, None], gradients, 0.0) / count)[0]
        adam = state.adam
        adam.hyperparams["learning_rate"] = learning_rate * (1 + jnp.cos(jnp.pi * done)) / 2
        step, adam = optimiser.update(gradient, adam)
        loss = jnp.sum(jnp.where(valid, losses, 0.0)) / count
        spent = Progress(products, loss, jnp.sum(~valid))
        network = network.with_weights(network.weights + step)
        return network, State(adam, targets, state.kept), spent

    return Method(init, update, batch)
