"""Differentiable physics: the loss's gradient runs back through the solver by its adjoint.

L = mean (|y|^2 + goal^2 (lambda . y / Cd)^2) / 2 over a batch, y the slip of the flow that the
network's traction drives; Adam. Um et al. 2020; Thuerey et al. 2021, chapter 5.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float

from surrogate.flow import steady
from surrogate.flow.newton import NewtonSettings
from surrogate.flow.steady import FlowState
from surrogate.flow.tangent import Effort, drag_weights, slip_adjoint
from surrogate.training.method import Method, Progress, keep, per_sample, predict


class State(NamedTuple):
    """Adam's moments and the last flow of every sample."""

    adam: optax.OptState
    flows: Float[Array, "samples 2 nx ny"]


def differentiable_physics(
    batch: int = 4,
    learning_rate: float = 1e-2,
    goal: float = 3.0,
    settings: NewtonSettings = NewtonSettings(1e-3, 8, 30),
    effort: Effort = Effort(3e-2, 30),
) -> Method:
    """DP: one warm-started forced flow and two adjoints per sample and step."""
    optimiser = optax.inject_hyperparams(optax.adam)(learning_rate)

    def init(network, physics):
        return State(optimiser.init(network.weights), physics.oseen.velocity)

    def sample_gradient(physics, index, amplitude, flow):
        domain, case = physics.domain, physics.case(index)
        velocity, info = steady.forced_flow(domain, case, amplitude, flow, settings)
        state = FlowState(velocity, amplitude)
        slip = steady.slip_residual(domain, case, state)
        weights, spent = drag_weights(domain, case, state, effort)
        drag = 2 * jnp.abs(physics.oseen.amplitude[index, 0])
        miss = weights @ slip / drag
        gradient, spent_too = slip_adjoint(
            domain, case, state, slip + goal**2 * miss * weights / drag, effort
        )
        valid = info.converged & jnp.all(jnp.isfinite(gradient))
        products = info.products + spent.products + spent_too.products
        return gradient, velocity, (slip @ slip + miss**2) / 2, valid, products

    def update(network, state, physics, batch, done):
        amplitudes, pull = jax.vjp(
            lambda w: predict(network.with_weights(w), physics, batch), network.weights
        )
        gradients, flows, losses, valid, products = per_sample(
            lambda i, a, u: sample_gradient(physics, i, a, u), batch, amplitudes, state.flows[batch]
        )
        count = jnp.maximum(jnp.sum(valid), 1)
        gradient = pull(jnp.where(valid[:, None], gradients, 0.0) / count)[0]
        adam = state.adam
        adam.hyperparams["learning_rate"] = learning_rate * (1 + jnp.cos(jnp.pi * done)) / 2
        step, adam = optimiser.update(gradient, adam)
        flows = keep(valid, flows, physics.oseen.velocity[batch])
        state = State(adam, state.flows.at[batch].set(flows))
        loss = jnp.sum(jnp.where(valid, losses, 0.0)) / count
        spent = Progress(jnp.sum(products), loss, jnp.sum(~valid))
        return network.with_weights(network.weights + step), state, spent

    return Method(init, update, batch)
