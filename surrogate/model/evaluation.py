"""Loads, and their novelty, of whole batches of bodies by a network: one program each."""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from surrogate.arrays import Numbers
from surrogate.body.validity import is_valid
from surrogate.compilation import compiled
from surrogate.model.confidence import Novelty
from surrogate.model.network import LoadNetwork
from surrogate.model.outputs import LOAD_NAMES
from surrogate.model.ranges import TrainedRanges
from surrogate.scene.limits import REYNOLDS, ROUNDING

MOST_BODIES = 1024  # whose novelty is computed at once
ONE_BODY = "(parameters),()->"  # begins signatures for ``jnp.vectorize``


@eqx.filter_jit
def network_loads(
    network: LoadNetwork, parameters: Float[Array, "*bodies parameters"], reynolds: Numbers
) -> Float[Array, "*batch 3"]:
    """Return Cd, Cl and Cm of bodies by a network, by one program for each shape of the batch."""
    return _of_each_load(network.loads, parameters, reynolds)


def novelty_of_loads(
    novelty: Novelty,
    parameters: Float[np.ndarray, "*bodies parameters"],
    reynolds: Float[np.ndarray, "*cases"],
) -> Float[np.ndarray, "*batch 3"]:
    """Return the novelty of Cd, Cl and Cm of bodies.

    Many bodies are taken ``MOST_BODIES`` at a time, since the gradients of one in all weights take
    a tenth of a megabyte.

    Args:
      novelty: the measure.
      parameters: of the bodies; leading axes broadcast with those of ``reynolds``.
      reynolds: U D / nu.
    """
    batch = np.broadcast_shapes(parameters.shape[:-1], reynolds.shape)
    if math.prod(batch) <= MOST_BODIES:
        return np.asarray(_novelty(novelty, parameters, reynolds))
    bodies = np.broadcast_to(parameters, (*batch, parameters.shape[-1]))
    bodies = bodies.reshape(-1, parameters.shape[-1])
    numbers = np.broadcast_to(reynolds, batch).ravel()
    parts = range(0, len(numbers), MOST_BODIES)
    at = [np.arange(start, start + MOST_BODIES) % len(numbers) for start in parts]  # of one size
    found = [np.asarray(_novelty(novelty, bodies[part], numbers[part])) for part in at]
    return np.concatenate(found)[: len(numbers)].reshape(*batch, len(LOAD_NAMES))


@compiled()
def _novelty(novelty, parameters, reynolds):
    return _of_each_load(novelty, parameters, reynolds)


@eqx.filter_jit
def loads_or_nan(
    network: LoadNetwork,
    ranges: TrainedRanges,
    parameters: Float[Array, "*bodies parameters"],
    reynolds: Numbers,
    extrapolate: bool,
) -> Float[Array, "*batch 3"]:
    """Return ``network_loads`` of traced bodies and Re, and NaN where an eager call would refuse.

    Args:
      network: that predicts the loads.
      ranges: in which it was trained.
      parameters: of the bodies.
      reynolds: U D / nu.
      extrapolate: answer outside the ranges as well.
    """
    lowest, highest = REYNOLDS[ranges.scene.dimension]

    def answered(body, re) -> Bool[Array, ""]:
        valid = is_valid(ranges.scene.family.body_class, body)
        valid &= (re >= lowest * (1 - ROUNDING)) & (re <= highest * (1 + ROUNDING))
        return valid & (extrapolate | jnp.all(ranges.excess(body, re) == 0))

    valid = jnp.vectorize(answered, signature=ONE_BODY + "()")(parameters, reynolds)
    loads = network_loads(network, parameters, reynolds)
    return loads * jnp.where(valid, 1.0, jnp.nan)[..., None]  # so is the gradient NaN


def _of_each_load(function, parameters, reynolds):
    """Apply a function of one body to many; a load of which it returns nothing is 0."""
    known = jnp.vectorize(function, signature=ONE_BODY + "(loads)")(parameters, reynolds)
    missing = len(LOAD_NAMES) - known.shape[-1]
    return jnp.concatenate([known, jnp.zeros((*known.shape[:-1], missing))], axis=-1)
