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

    Measured over the default scenes by the study ``foreseen``.

    Attributes:
      flow: of a body's flow, the assembly of its operators included.
      adjoint: of the adjoint flow that gives its shape gradient.
      renewal: of assembling the operators of a training's body again at every evaluation.
      design_flows: flows, each with its adjoint, of a design without a surrogate.
      overhead: seconds of a whole flow over those of its convolutions alone; the rest is
        convection, Krylov vectors, and in 3-D double precision.
    """

    flow: float
    adjoint: float
    renewal: float
    design_flows: float
    overhead: float


CONVOLUTIONS = {
    2: Convolutions(34.0, 8.4, 0.0, 10.8, 1.7),
    3: Convolutions(47.0, 7.6, 33.0, 5.0, 1.8),
}
# Without the mirror plane y = 0 a domain has twice the rows, and gradients take three adjoints. A
# body's operators take about as many convolutions as with it, see ``CompressedResponse``.
WHOLE, ADJOINTS = 2, 3


def convolutions(dimension: int, symmetric: bool = True) -> Convolutions:
    """Return the average convolutions with G of one body.

    Args:
      dimension: 2 or 3.
      symmetric: whether bodies have the mirror plane y = 0, in 3-D z = 0.
    """
    takes = CONVOLUTIONS[dimension]
    return takes if symmetric else takes._replace(adjoint=ADJOINTS * takes.adjoint)


@functools.cache
def seconds_per_convolution(shape: tuple[int, ...], symmetric: bool = True) -> float:
    """Return the seconds of a flow divided by its convolutions with G, on this machine.

    Args:
      shape: cells of the part of the domain that is gridded if the flow is symmetric.
      symmetric: whether it is; else the whole domain is gridded.
    """
    seconds = CONVOLUTIONS[len(shape)].overhead * convolution_seconds(shape)
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
