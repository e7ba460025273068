"""The history of a training: errors on held-out bodies over iterations, work and time."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.model.network import LoadNetwork
from surrogate.scene.samples import Samples

MAX_POINTS = 2000  # where the number of points is limited by time only


class HistoryPoint(NamedTuple):
    """One point of a training's history; errors of the drag are relative, on held-out bodies."""

    iteration: int
    seconds: float
    green_applications: int
    error_mean: float
    error_max: float
    loss: float
    failed: int


def blank_history(points: int) -> Float[np.ndarray, "points 7"]:
    """Return an empty history: zeros for ``points`` points and one more, at most 2001."""
    return np.zeros((min(points, MAX_POINTS) + 1, len(HistoryPoint._fields)))


def with_point(history: Float[AnyArray, "points 7"], point: HistoryPoint) -> np.ndarray:
    """Return the history with one more point; if it is full, the point replaces the last one."""
    history = np.array(history)
    history[min(len(points_of(history)), len(history) - 1)] = point
    return history


def points_of(history: Float[AnyArray, "points 7"]) -> tuple[HistoryPoint, ...]:
    """Return the points of a history array, without its empty rows."""
    return tuple(
        HistoryPoint(int(i), s, int(g), mean, worst, loss, int(failed))
        for i, s, g, mean, worst, loss, failed in history.tolist()
        if i > 0
    )


@jax.jit
def load_errors(
    network: LoadNetwork, samples: Samples, loads: Float[AnyArray, "samples loads"]
) -> Float[Array, "samples loads"]:
    """Return the absolute errors of the network's Cd (, Cl, Cm) over Cd, for each sample.

    Args:
      network: the network.
      samples: on which its errors are measured.
      loads: Cd (, Cl, Cm) of the samples' flows.
    """
    predicted = jax.vmap(network.loads)(*samples)
    return jnp.abs(predicted - loads) / loads[:, :1]
