"""What every training method is: an (init, update) pair, in optax's shape."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PyTree

from surrogate.arrays import AnyArray
from surrogate.model.network import DragNetwork
from surrogate.training.physics import Physics

Batch = Int[AnyArray, " batch"]


class Progress(NamedTuple):
    """What one update spent and saw: applications of G, loss, samples left out.

    ``waiting`` are applications of G that idle devices and lanes could have done meanwhile.
    """

    products: Int[AnyArray, ""]
    loss: Float[AnyArray, ""]
    failed: Int[AnyArray, ""]
    waiting: Int[AnyArray, ""]


class Method(NamedTuple):
    """``init(network, physics) -> state``; ``update(network, state, physics, batch, progress)``.

    ``update`` returns the network, the state and what it cost; ``done`` is the fraction of the
    training that lies behind, for schedules. Every device runs ``update`` on its own rows of what
    is ``Owned``, and comes to the same network.
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


def predict(network: DragNetwork, physics: Physics, batch: Batch) -> Float[Array, "batch modes"]:
    """Traction modes of a batch of samples."""
    return jax.vmap(network)(physics.samples.parameters[batch], physics.samples.reynolds[batch])
