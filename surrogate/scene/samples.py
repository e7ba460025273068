"""Random bodies and Reynolds numbers: training samples, their batches, and held-out samples."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import numpy as np
import scipy  # its submodules load at first use; scipy.stats takes half a second
from jaxtyping import Float, Int

from surrogate.arrays import AnyArray
from surrogate.scene.scene import Scene

LARGEST_SEED = 2**31 - 1
MIN_DRAW = 128  # Sobol points at a time: enough to find out that all bodies cross themselves


class Samples(NamedTuple):
    """Samples of a scene: parameters of bodies, and their Reynolds numbers."""

    parameters: Float[AnyArray, "samples parameters"]
    reynolds: Float[AnyArray, " samples"]

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.reynolds)

    def head(self, count: int) -> "Samples":
        """Return the first ``count`` samples."""
        return Samples(*(part[:count] for part in self))

    def at(self, index: AnyArray) -> "Samples":
        """Return the samples at these indices, or where a mask is true."""
        return Samples(*(part[index] for part in self))


def training_samples(
    scene: Scene,
    seed: int,
    count: int,
    infill: Sequence[int] = (),
    symmetric_share: float = 0.0,
) -> Samples:
    """Draw training samples by a scrambled Sobol sequence over the ranges and log Re.

    Bodies that cross themselves are skipped. A random share of the others can be made symmetric
    fore and aft (``Family.symmetric_fore_and_aft``).

    Args:
      scene: whose family and Reynolds numbers they are drawn from.
      seed: of the sequence.
      count: number of samples.
      infill: the positions in the sequence of the last samples; the others are the first of it.
      symmetric_share: of the bodies that are made symmetric.
    """
    positions = np.concatenate([np.arange(count - len(infill)), np.asarray(infill, int)])
    needed = int(positions.max(initial=-1)) + 1
    low, high = np.log(scene.reynolds)
    sequence = scipy.stats.qmc.Sobol(len(scene.family.names) + 1, rng=seed)
    bodies, log_re = np.empty((0, len(scene.family.names))), np.empty(0)
    while len(bodies) < needed:
        shares = sequence.random(max(2 ** needed.bit_length(), MIN_DRAW))
        drawn = scene.family.within(shares[:, :-1])
        clear = scene.family.clear(drawn)
        bodies = np.concatenate([bodies, drawn[clear]])
        log_re = np.concatenate([log_re, low + (high - low) * shares[clear, -1]])
    bodies = bodies[positions]
    if symmetric_share:
        draws = np.random.default_rng([seed, 1]).random(needed)[positions]
        symmetric = scene.family.symmetric_fore_and_aft(bodies)
        bodies = np.where((draws < symmetric_share)[:, None], symmetric, bodies)
    return Samples(bodies, np.exp(log_re[positions]))


def shuffled_batches(
    seed: int, count: int, size: int
) -> Callable[[int], Int[np.ndarray, " batch"]]:
    """Return the function from an iteration to the indices of its batch, shuffled by epoch.

    All batches have the same size: what remains of an epoch's order is left out.

    Args:
      seed: of the training.
      count: number of samples.
      size: number of samples of a batch; all samples if there are fewer.
    """
    key, size = jax.random.fold_in(jax.random.key(seed), 1), min(size, count)
    per_epoch = count // size

    def batch(iteration):
        epoch, index = divmod(iteration, per_epoch)
        order = jax.random.permutation(jax.random.fold_in(key, epoch), count)
        return np.asarray(order)[index * size : (index + 1) * size]

    return batch


def held_out_samples(scene: Scene, seed: int, count: int) -> Samples:
    """Draw held-out samples: bodies as ``Family.sample`` draws them, Re uniform in log Re.

    Independent of the training samples of the same seed.
    """
    shape_key, re_key = jax.random.split(_keys(seed)[0])
    low, high = np.log(scene.reynolds)
    log_re = np.asarray(jax.random.uniform(re_key, (count,), minval=low, maxval=high))
    return Samples(scene.family.sample(shape_key, count), np.exp(log_re))


def network_key(seed: int) -> jax.Array:
    """Return the random key of a training's initial weights."""
    return _keys(seed)[1]


def _keys(seed):
    """Return the keys of held-out samples and of weights."""
    return jax.random.split(jax.random.key(seed), 3)[1:]
