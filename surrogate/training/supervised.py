"""Supervised regression: every sample's body flow is solved once, the network learns the answer.

The baseline a user would pick: exact targets first, then only Adam, same loss as SIP's.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float

from surrogate.flow import steady
from surrogate.flow.newton import NewtonSettings
from surrogate.training.method import Method, Progress, per_sample
from surrogate.training.sip import imitate


class State(NamedTuple):
    """Adam's moments, labels, and which samples have theirs."""

    adam: optax.OptState
    labels: Float[Array, "samples modes"]
    known: Bool[Array, " samples"]


def supervised(
    batch: int = 8,
    network_steps: int = 50,
    learning_rate: float = 3e-3,
    goal: float = 30.0,
    settings: NewtonSettings = NewtonSettings(1e-5, 15, 40),
) -> Method:
    """Body flows of a batch where labels are missing, then Adam on all labels so far."""
    optimiser = optax.inject_hyperparams(optax.adam)(learning_rate)

    def init(network, physics):
        known = jnp.zeros(physics.count, bool)
        return State(optimiser.init(network.weights), physics.oseen.amplitude, known)

    def label(physics, index, known, amplitude):
        def solved():
            flow, info = steady.body_flow(physics.domain, physics.case(index), settings=settings)
            return flow.amplitude, info.converged, info.products

        return jax.lax.cond(known, lambda: (amplitude, known, jnp.array(0)), solved)

    def update(network, state, physics, batch, done):
        labels, known, products = per_sample(
            lambda i, k, a: label(physics, i, k, a), batch, state.known[batch], state.labels[batch]
        )
        labels = state.labels.at[batch].set(labels)
        everyone = state.known.at[batch].set(known)
        rate = learning_rate * (1 + jnp.cos(jnp.pi * done)) / 2
        network, adam, loss = imitate(
            network, state.adam, optimiser, physics, labels, everyone, goal, rate, network_steps
        )
        return (
            network,
            State(adam, labels, everyone),
            Progress(jnp.sum(products), loss, jnp.sum(~known)),
        )

    return Method(init, update, batch)
