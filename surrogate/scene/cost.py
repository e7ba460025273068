"""Forecasts of what flows cost: convolutions with G as measured, seconds by a short benchmark."""

import functools
import time
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

REPEATS = 6  # of a benchmark, whose median counts


class Convolutions(NamedTuple):
    """Average numbers of convolutions with the Green's function G for one body (RESULTS.md).

    Measured by the study ``foreseen`` over the default scenes, ``scripts/lift.toml`` and
    ``scripts/particle.toml``.

    Attributes:
      flow: of a body's flow, the assembly of its operators included.
      adjoint: of the adjoint flows that give the gradients of its loads, one for each load.
      renewal: of assembling the operators of a training's body at every evaluation, where they are
        too large to be stored.
      design_flows: flows, each with its adjoint, of a design without a surrogate.
      overhead: seconds of a whole flow over those of its convolutions alone, as
        ``convolution_seconds`` has them. It depends on the processor and on the hour: on an AMD
        EPYC 0.8 and 2.0 were measured for symmetric 3-D bodies on two days.
    """

    flow: float
    adjoint: float
    renewal: float
    design_flows: float
    overhead: float


# Of one body, by the dimension, and whether bodies have the mirror plane y = 0, in 3-D z = 0.
CONVOLUTIONS = {
    (2, True): Convolutions(35.0, 7.7, 0.0, 6.0, 1.7),
    (2, False): Convolutions(52.0, 40.0, 19.0, 9.1, 1.3),
    (3, True): Convolutions(46.0, 6.3, 33.0, 5.0, 1.0),
    (3, False): Convolutions(63.0, 22.0, 44.0, 4.0, 0.6),
}


@functools.cache
def seconds_per_convolution(shape: tuple[int, ...], symmetric: bool) -> float:
    """Return the seconds of a flow divided by its convolutions with G, on this machine.

    Args:
      shape: cells of the grid.
      symmetric: whether bodies have the mirror plane y = 0, in 3-D z = 0.
    """
    return CONVOLUTIONS[len(shape), symmetric].overhead * convolution_seconds(shape)


def convolution_seconds(shape: tuple[int, ...]) -> float:
    """Return the measured seconds of one convolution: transforms there and back around one product.

    Args:
      shape: cells of the grid.
    """
    nx, *across = shape
    matrices = [np.ones((rows, 2 * rows + 1), np.float32) for rows in across]

    @jax.jit
    def convolve(field):
        lateral = functools.reduce(_along_next_axis, matrices, field)
        spectrum = jnp.fft.rfft(lateral, n=2 * nx, axis=1)
        product = sum(spectrum) + spectrum
        lateral = jnp.fft.irfft(product, n=2 * nx, axis=1)[:, :nx]
        return functools.reduce(_along_next_axis, [m.T for m in matrices], lateral)

    field = jnp.ones((len(shape), *shape), jnp.float32)
    return median_seconds(lambda: convolve(field))


def median_seconds(call: Callable[[], PyTree], repeats: int = REPEATS) -> float:
    """Return the median of the seconds of several calls, after one that may compile.

    Args:
      call: function whose result is waited for.
      repeats: number of calls that count.
    """
    jax.block_until_ready(call())
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        jax.block_until_ready(call())
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))


def _along_next_axis(field, matrix):
    """Multiply by a matrix along the first lateral axis, which becomes the last one."""
    return jnp.tensordot(field, matrix, axes=[[2], [0]])
