"""Loads, and their novelty, of whole batches of bodies by a network: one program each."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from surrogate.arrays import Numbers
from surrogate.body.validity import is_valid
from surrogate.compilation import compiled
from surrogate.model.confidence import Novelty
from surrogate.model.network import LoadNetwork
from surrogate.model.outputs import LOAD_NAMES
from surrogate.model.ranges import TrainedRanges
from surrogate.scene.limits import REYNOLDS, ROUNDING

ONE_BODY = "(parameters),()->"  # begins signatures for ``jnp.vectorize``


@eqx.filter_jit
def network_loads(
    network: LoadNetwork, parameters: Float[Array, "*bodies parameters"], reynolds: Numbers
) -> Float[Array, "*batch 3"]:
    """Return Cd, Cl and Cm of bodies by a network, by one program for each shape of the batch."""
    return _of_each_load(network.loads, parameters, reynolds)


@compiled()
def novelty_of_loads(
    novelty: Novelty, parameters: Float[Array, "*bodies parameters"], reynolds: Numbers
) -> Float[Array, "*batch 3"]:
    """Return the novelty of Cd, Cl and Cm of bodies, by one program for each batch's shape."""
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
