"""Differentiable physics: the loss's gradient runs back through the solver by its adjoint.

L = mean (|y|^2 + goal^2 (lambda . y / Cd)^2) / 2 over a batch, y the slip of the flow that the
network's traction drives; Adam. Um et al. 2020; Thuerey et al. 2021, chapter 5.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float

from surrogate.flow.solver import steady
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.solver.tangent import Effort, drag_weights, slip_adjoint
from surrogate.training.methods.method import Method, Progress, keep, per_sample, predict
from surrogate.training.methods.targets import (
    Targets,
    improve,
    no_targets,
    one_step,
    oseen_compliances,
)

FLOW = NewtonSettings(3e-3, 8, 30)
ADJOINT = Effort(0.1, 30)


class DpState(NamedTuple):
    """Adam's moments; the last flow of every sample with its target, and Oseen compliances."""

    adam: optax.OptState
    targets: Targets
    compliance: Float[Array, "samples modes modes"]


def differentiable_physics(
    lagged: bool = False,
    batch: int = 4,
    learning_rate: float = 1e-2,
    goal: float = 3.0,
) -> Method:
    """DP: one warm-started forced flow and two adjoints per sample and step, as published.

    On ``lagged`` physics the slip is that of ``targets``, by Oseen compliances.
    """
    optimiser = optax.inject_hyperparams(optax.adam)(learning_rate)

    def init(network, physics):
        adam = optimiser.init(network.weights)
        return DpState(adam, no_targets(physics), oseen_compliances(physics))

    def driven(physics, index, amplitude, flow):
        domain, case = physics.domain, physics.case(index)
        velocity, info = steady.forced_flow(domain, case, amplitude, flow, FLOW)
        state = FlowState(velocity, amplitude)
        slip = steady.slip_residual(domain, case, state)
        weights, spent = drag_weights(domain, case, state, ADJOINT)
        row = goal / (2 * jnp.abs(physics.oseen.amplitude[index, 0]))
        miss = row * (weights @ slip)
        pulled = slip + row * miss * weights
        gradient, spent_too = slip_adjoint(domain, case, state, pulled, ADJOINT)
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
        targets, _, products = improve(physics, batch, predicted, state.targets, one_step())
        away = predicted - targets.tractions[batch]
        slip = jnp.einsum("bym,bm->by", state.compliance[batch], away)
        row = goal / jnp.abs(physics.oseen.amplitude[batch, 0])
        gradients = jnp.einsum("bym,by->bm", state.compliance[batch], slip)
        gradients = gradients.at[:, 0].add(row**2 * away[:, 0])
        losses = (jnp.sum(slip**2, axis=1) + (row * away[:, 0]) ** 2) / 2
        return gradients, losses, targets, targets.known[batch], products

    def update(network, state, physics, batch, done):
        predicted, pull = jax.vjp(
            lambda w: predict(network.with_weights(w), physics, batch), network.weights
        )
        see = linearised if lagged else exact
        gradients, losses, targets, valid, products = see(physics, batch, predicted, state)
        count = jnp.maximum(jnp.sum(valid), 1)
        gradient = pull(jnp.where(valid[:, None], gradients, 0.0) / count)[0]
        adam = state.adam
        adam.hyperparams["learning_rate"] = learning_rate * (1 + jnp.cos(jnp.pi * done)) / 2
        step, adam = optimiser.update(gradient, adam)
        loss = jnp.sum(jnp.where(valid, losses, 0.0)) / count
        spent = Progress(products, loss, jnp.sum(~valid))
        network = network.with_weights(network.weights + step)
        return network, DpState(adam, targets, state.compliance), spent

    return Method(init, update, batch)
