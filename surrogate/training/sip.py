"""Scale-invariant physics: the solver is inverted, the network learns the inverse's answer.

Each physics step moves a batch of samples by one coupled Newton step of body flow,
a+ = a - (dy/da)^+ y, started at the network's prediction; the network then takes several Adam
steps on L = mean |(a - stop(a+)) / scale|^2 / 2 over all targets kept so far, the drag's mode
weighted by the goal. A sample whose drag no longer moves is settled and not inverted again.
Holl, Koltun, Thuerey 2022 (Scale-invariant Learning by Physics Inversion).
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float

from surrogate.flow.steady import FlowState
from surrogate.flow.tangent import Effort, coupled_step
from surrogate.training.method import Method, Progress, keep, per_sample, predict


class State(NamedTuple):
    """Adam's moments; per sample the last flow, its target traction, whether it has one, and
    whether that is final."""

    adam: optax.OptState
    flows: Float[Array, "samples 2 nx ny"]
    targets: Float[Array, "samples modes"]
    known: Bool[Array, " samples"]
    settled: Bool[Array, " samples"]


def scale_invariant_physics(
    batch: int = 8,
    network_steps: int = 50,
    learning_rate: float = 3e-3,
    goal: float = 30.0,
    settle: float = 1e-4,
    effort: Effort = Effort(1e-2, 30),
) -> Method:
    """SIP with kept targets: one coupled step per sample, ``network_steps`` on all targets."""
    optimiser = optax.inject_hyperparams(optax.adam)(learning_rate)

    def init(network, physics):
        none = jnp.zeros(physics.count, bool)
        start = physics.oseen
        return State(optimiser.init(network.weights), start.velocity, start.amplitude, none, none)

    def invert(physics, index, amplitude, flow, known):
        case = physics.case(index)
        flow = jnp.where(known, flow, jnp.tensordot(amplitude, case.response, axes=1))
        state, spent = coupled_step(physics.domain, case, FlowState(flow, amplitude), effort)
        valid = spent.converged & (state.amplitude[0] < 0) & jnp.all(jnp.isfinite(state.amplitude))
        return state, valid, spent.products

    def update(network, state, physics, batch, done):
        flows, targets = state.flows[batch], state.targets[batch]
        known, settled = state.known[batch], state.settled[batch]

        def visit(index, amplitude, flow, target, known, settled):
            rest = FlowState(flow, target), jnp.array(True), jnp.array(0)
            step = functools.partial(invert, physics, index, amplitude, flow, known)
            return jax.lax.cond(settled, lambda: rest, step)

        inverted, valid, products = per_sample(
            visit, batch, predict(network, physics, batch), flows, targets, known, settled
        )
        moved = jnp.abs(inverted.amplitude[:, 0] / targets[:, 0] - 1) > settle
        kept = keep(valid, inverted, FlowState(flows, targets))
        flows = state.flows.at[batch].set(kept.velocity)
        targets = state.targets.at[batch].set(kept.amplitude)
        settled = state.settled.at[batch].set(settled | (valid & known & ~moved))
        known = state.known.at[batch].set(valid | known)
        rate = learning_rate * (1 + jnp.cos(jnp.pi * done)) / 2
        network, adam, loss = imitate(
            network, state.adam, optimiser, physics, targets, known, goal, rate, network_steps
        )
        spent = Progress(jnp.sum(products), loss, jnp.sum(~valid))
        return network, State(adam, flows, targets, known, settled), spent

    return Method(init, update, batch)


def imitate(network, adam, optimiser, physics, targets, known, goal, rate, steps):
    """Adam steps towards target tractions of the samples that have one."""
    scale = jax.vmap(network.scale)(physics.samples.reynolds)
    everyone = jnp.arange(physics.count)

    def loss_of(weights):
        miss = predict(network.with_weights(weights), physics, everyone) - targets
        modes = jnp.mean((miss / scale) ** 2, axis=1)
        drag = (miss[:, 0] / targets[:, 0]) ** 2
        losses = jnp.where(known, modes + goal**2 * drag, 0.0)
        return jnp.sum(losses) / jnp.maximum(jnp.sum(known), 1) / 2

    def step(carry, _):
        weights, adam = carry
        loss, gradient = jax.value_and_grad(loss_of)(weights)
        change, adam = optimiser.update(gradient, adam)
        return (weights + change, adam), loss

    adam.hyperparams["learning_rate"] = rate
    (weights, adam), losses = jax.lax.scan(step, (network.weights, adam), length=steps)
    return network.with_weights(weights), adam, losses[-1]
