"""What flows will cost, foreseen: applications of G by measurement, seconds by a blink of work."""

import functools
import time
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

REPEATS = 7


class Applications(NamedTuple):
    """Applications of G that a body takes on average, over the default scenes (RESULTS.md).

    Of a body's flow, preparation included, of the adjoint that its shape gradient takes, of
    preparing a training's body anew, and how many flows with their adjoints a design by them alone
    takes. ``overhead`` is of a whole flow's seconds over its convolutions alone: convection,
    Krylov vectors, in space double precision.
    """

    flow: float
    adjoint: float
    renewal: float
    design_flows: float
    overhead: float


APPLICATIONS = {
    2: Applications(34.0, 8.4, 0.0, 10.8, 1.7),
    3: Applications(47.0, 7.6, 33.0, 5.0, 1.8),
}


@functools.cache
def application_seconds(shape: tuple[int, ...]) -> float:
    """Seconds of a flow per application of G in a symmetric window of ``shape`` cells."""
    return APPLICATIONS[len(shape)].overhead * convolution_seconds(shape)


def convolution_seconds(shape: tuple[int, ...]) -> float:
    """Seconds of a convolution in this window: transforms there and back around one product."""
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
    """A matrix along the first axis across the stream, which then is the last."""
    return jnp.tensordot(field, matrix, axes=[[2], [0]])
