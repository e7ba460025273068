"""Bodies and Reynolds numbers of trainings, and those held out from them: drawn here alone."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.scene.scene import Scene


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
    """What a training of this seed learns from."""
    return draw_samples(scene, _keys(seed)[0], count)


def held_out_samples(scene: Scene, seed: int, count: int) -> Samples:
    """What no training of this seed has seen."""
    return draw_samples(scene, _keys(seed)[1], count)


def network_key(seed: int) -> jax.Array:
    """From which the initial weights of a training are drawn."""
    return _keys(seed)[2]


def draw_samples(scene: Scene, key: jax.Array, count: int) -> Samples:
    """Bodies uniform in the family's bounds, Re uniform in its logarithm."""
    shape_key, re_key = jax.random.split(key)
    low, high = np.log(scene.reynolds)
    return Samples(
        scene.family.sample(shape_key, count),
        jnp.exp(jax.random.uniform(re_key, (count,), minval=low, maxval=high)),
    )


def joined(samples: list[Samples]) -> Samples:
    """Samples one after another."""
    return Samples(*(np.concatenate(parts) for parts in zip(*samples, strict=True)))


def _keys(seed):
    return jax.random.split(jax.random.key(seed), 3)
