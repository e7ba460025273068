"""What every training method is: an (init, update) pair, in optax's shape."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PyTree

from surrogate.model.network import DragNetwork
from surrogate.training.physics import Physics

Batch = Int[Array, " batch"]


class Progress(NamedTuple):
    """What one update spent and saw: applications of G, loss, samples left out."""

    products: Int[Array, ""]
    loss: Float[Array, ""]
    failed: Int[Array, ""]


class Method(NamedTuple):
    """``init(network, physics) -> state``; ``update(network, state, physics, batch, progress)``.

    ``update`` returns the network, the state and what it cost; ``done`` is the fraction of the
    training that lies behind, for schedules.
    """

    init: Callable[[DragNetwork, Physics], PyTree]
    update: Callable[[DragNetwork, Any, Physics, Batch, Float[Array, ""]], tuple]
    batch: int


def adam_that_ends(learning_rate: float) -> optax.GradientTransformation:
    """Adam whose rate ``slowed`` sets."""
    return optax.inject_hyperparams(optax.adam)(learning_rate)


def slowed(adam: optax.OptState, learning_rate: float, done: Array) -> optax.OptState:
    """Its rate falls by a cosine to nought as the training ends."""
    adam.hyperparams["learning_rate"] = learning_rate * (1 + jnp.cos(jnp.pi * done)) / 2
    return adam


def per_sample(function: Callable, *arguments: PyTree) -> PyTree:
    """Apply to the samples of a batch one after another: each stops when it is done."""
    return jax.lax.map(lambda packed: function(*packed), arguments)


def predict(network: DragNetwork, physics: Physics, batch: Batch) -> Float[Array, "batch modes"]:
    """Traction modes of a batch of samples."""
    return jax.vmap(network)(physics.samples.parameters[batch], physics.samples.reynolds[batch])


def keep(mask: Array, new: PyTree, old: PyTree) -> PyTree:
    """Sample by sample, the new value where ``mask`` holds."""

    def select(a, b):
        return jnp.where(mask.reshape(mask.shape + (1,) * (a.ndim - 1)), a, b)

    return jax.tree.map(select, new, old)
