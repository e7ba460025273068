"""Random bodies and Reynolds numbers: training samples and held-out samples."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.stats import qmc

from surrogate.arrays import AnyArray
from surrogate.scene.scene import Scene

MIN_DRAW = 128  # Sobol points at a time: enough to find out that all bodies cross themselves


class Samples(NamedTuple):
    """Bodies and Reynolds numbers."""

    parameters: Float[AnyArray, "samples parameters"]
    reynolds: Float[AnyArray, " samples"]

    @property
    def count(self) -> int:
        return len(self.reynolds)

    def head(self, count: int) -> "Samples":
        """The first ``count`` samples."""
        return Samples(*(part[:count] for part in self))

    def at(self, index: AnyArray) -> "Samples":
        """The samples at these indices, or where a mask is true."""
        return Samples(*(part[index] for part in self))


def training_samples(scene: Scene, seed: int, count: int) -> Samples:
    """Draw training samples by a scrambled Sobol sequence over the parameters and log Re.

    Bodies that cross themselves are skipped.
    """
    low, high = np.concatenate([scene.family.bounds, np.log([scene.reynolds])]).T
    sequence = qmc.Sobol(low.size, rng=seed)
    rows = np.empty((0, low.size))
    while len(rows) < count:
        drawn = low + (high - low) * sequence.random(max(2 ** count.bit_length(), MIN_DRAW))
        rows = np.concatenate([rows, drawn[scene.family.clear(drawn[:, :-1])]])
    return Samples(jnp.asarray(rows[:count, :-1]), jnp.exp(jnp.asarray(rows[:count, -1])))


def held_out_samples(scene: Scene, seed: int, count: int) -> Samples:
    """Draw held-out samples: bodies uniform in their bounds, Re uniform in log Re.

    Independent of the training samples of the same seed.
    """
    shape_key, re_key = jax.random.split(_keys(seed)[0])
    low, high = np.log(scene.reynolds)
    return Samples(
        scene.family.sample(shape_key, count),
        jnp.exp(jax.random.uniform(re_key, (count,), minval=low, maxval=high)),
    )


def network_key(seed: int) -> jax.Array:
    """The random key of a training's initial weights."""
    return _keys(seed)[1]


def _keys(seed):
    """Keys of held-out samples and of weights."""
    return jax.random.split(jax.random.key(seed), 3)[1:]
