"""Bodies and Reynolds numbers of trainings, and those held out from them: drawn here alone."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.stats import qmc

from surrogate.arrays import AnyArray
from surrogate.scene.scene import Scene

LEAST_DRAWN = 128  # at once: enough to see a family whose bodies all cross themselves


class Samples(NamedTuple):
    """Bodies and Reynolds numbers."""

    parameters: Float[AnyArray, "samples parameters"]
    reynolds: Float[AnyArray, " samples"]

    @property
    def count(self) -> int:
        return len(self.reynolds)

    def head(self, count: int) -> "Samples":
        """The first of them."""
        return Samples(*(part[:count] for part in self))


def training_samples(scene: Scene, seed: int, count: int) -> Samples:
    """What a training of this seed learns from: spread evenly, by a scrambled Sobol sequence."""
    low, high = np.concatenate([scene.family.bounds, np.log([scene.reynolds])]).T
    sequence = qmc.Sobol(low.size, rng=seed)
    rows = np.empty((0, low.size))
    while len(rows) < count:
        drawn = low + (high - low) * sequence.random(max(2 ** count.bit_length(), LEAST_DRAWN))
        rows = np.concatenate([rows, drawn[scene.family.clear(drawn[:, :-1])]])
    return Samples(jnp.asarray(rows[:count, :-1]), jnp.exp(jnp.asarray(rows[:count, -1])))


def held_out_samples(scene: Scene, seed: int, count: int) -> Samples:
    """What no training of this seed has seen: bodies uniform in their bounds, Re in log Re."""
    shape_key, re_key = jax.random.split(_keys(seed)[0])
    low, high = np.log(scene.reynolds)
    return Samples(
        scene.family.sample(shape_key, count),
        jnp.exp(jax.random.uniform(re_key, (count,), minval=low, maxval=high)),
    )


def network_key(seed: int) -> jax.Array:
    """From which the initial weights of a training are drawn."""
    return _keys(seed)[1]


def _keys(seed):
    """For held-out bodies, for weights."""
    return jax.random.split(jax.random.key(seed), 3)[1:]
