"""Forecasts of what flows cost: convolutions with G as measured, seconds by a short benchmark."""

import functools
import time
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

REPEATS = 7  # of the benchmark, whose median counts


class Convolutions(NamedTuple):
    """Average numbers of convolutions with the Green's function G for one body (RESULTS.md).

    Measured by the study ``foreseen``: of bodies with a mirror plane over the default scenes, of
    bodies with lift over those of ``scripts/lift.toml`` and ``scripts/particle.toml``.

    Attributes:
      flow: of a body's flow, the assembly of its operators included.
      adjoint: of the adjoint flows that give the gradients of its loads.
      renewal: of assembling the operators of a training's body again at every evaluation.
      design_flows: flows, each with its adjoints, of a design without a surrogate.
      overhead: seconds of a whole flow over those of its convolutions alone; the rest is
        convection, Krylov vectors, and in 3-D double precision.
    """

    flow: float
    adjoint: float
    renewal: float
    design_flows: float
    overhead: float


CONVOLUTIONS = {  # by the dimension, and whether bodies have a mirror plane along the stream
    (2, True): Convolutions(34.0, 8.4, 0.0, 10.8, 1.7),
    (3, True): Convolutions(47.0, 7.6, 33.0, 5.0, 1.8),
    (2, False): Convolutions(60.0, 25.0, 19.0, 4.0, 1.7),
    (3, False): Convolutions(60.0, 25.0, 54.0, 4.0, 1.8),
}
WHOLE = 2  # a domain without the mirror plane has this many times the rows


@functools.cache
def seconds_per_convolution(shape: tuple[int, ...], symmetric: bool = True) -> float:
    """Return the seconds of a flow divided by its convolutions with G, on this machine.

    Args:
      shape: cells of the part of the domain that is gridded if the flow is symmetric.
      symmetric: whether it is; else the whole domain is gridded.
    """
    seconds = CONVOLUTIONS[len(shape), symmetric].overhead * convolution_seconds(shape)
    return seconds if symmetric else WHOLE * seconds


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
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        jax.block_until_ready(convolve(field))
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds[1:]))


def _along_next_axis(field, matrix):
    """Multiply by a matrix along the first lateral axis, which becomes the last one."""
    return jnp.tensordot(field, matrix, axes=[[2], [0]])
