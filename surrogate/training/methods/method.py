"""What every training method is: it visits flows, and learns of what they tell."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PyTree

from surrogate.arrays import AnyArray
from surrogate.devices import Sharded
from surrogate.model.network import DragNetwork
from surrogate.training.physics import Physics
from surrogate.training.samples import Samples

Batch = Int[AnyArray, " batch"]


class LabelStore(Protocol):
    """What flows have told so far: a row for every sample, the same on every device."""

    def asks(self, batch: Batch) -> bool:
        """Whether a visit to these samples could tell more."""
        ...


class EvaluationCost(NamedTuple):
    """What a visit took: applications of G, samples left out.

    ``idle_work`` are applications of G that idle devices and lanes could have done meanwhile.
    """

    products: Int[AnyArray, ""]
    failed: Int[AnyArray, ""]
    idle_work: Int[AnyArray, ""]


class Method(NamedTuple):
    """``init``, ``visit`` and ``learn``, to be traced; a step is about ``batch`` samples.

    ``init(network, physics) -> (memory, lessons)``: what the method itself remembers, and what
    flows have told before any was visited.

    ``visit(network, physics, lessons, flows, batch) -> (lessons, flows, spent)``: run by every
    device on its own rows of a chunk of the batch, of which alone ``physics`` and ``flows`` hold
    the fields.

    ``learn(network, memory, lessons, samples, batch, done) -> (network, memory, loss)``: run by
    one device; ``done`` is the fraction of the training that lies behind, for schedules.
    """

    init: Callable[[DragNetwork, Physics], tuple[PyTree, LabelStore]]
    visit: Callable[
        [DragNetwork, Physics, Any, Sharded, Batch], tuple[LabelStore, Sharded, EvaluationCost]
    ]
    learn: Callable[[DragNetwork, Any, Any, Samples, Batch, Float[Array, ""]], tuple]
    batch: int


def evaluation_cost(told: Any, physics: Physics, batch: Batch, idle_work: Array) -> EvaluationCost:
    """What answers with ``products`` and ``valid`` took; nobody's are no failures."""
    failed = ~told.valid & (batch < physics.count)
    return EvaluationCost(jnp.sum(told.products), jnp.sum(failed), idle_work)


def adam_that_ends(learning_rate: float) -> optax.GradientTransformation:
    """Adam whose rate ``slowed`` sets."""
    return optax.inject_hyperparams(optax.adam)(learning_rate)


def slowed(adam: optax.OptState, learning_rate: float, done: Array) -> optax.OptState:
    """Its rate falls by a cosine to nought as the training ends."""
    adam.hyperparams["learning_rate"] = learning_rate * (1 + jnp.cos(jnp.pi * done)) / 2
    return adam


def predict(network: DragNetwork, samples: Samples, batch: Batch) -> Float[Array, "batch modes"]:
    """Traction modes of a batch of samples."""
    return jax.vmap(network)(samples.parameters[batch], samples.reynolds[batch])
