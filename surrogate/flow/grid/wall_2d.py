"""Wall treatment in 2-D: a slip law on the wall."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.immersed import Wall, slip_law
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes_2d import Modes2D
from surrogate.flow.grid.retraction import mean_step, retraction_at


def wall_2d(
    lattice: Lattice,
    modes: Modes2D,
    markers: Float[AnyArray, "nodes 2"],
    reynolds: Float[AnyArray, ""] | float,
) -> Wall:
    """Return the discretised wall of a 2-D body, with the slip law that a smeared sheet obeys.

    Args:
      lattice: the grid.
      modes: traction modes.
      markers: of the contour at equidistant t, clockwise from the nose, in D.
      reynolds: U D / nu.
    """
    normal = outward(markers)
    speed = jnp.linalg.norm(normal, axis=1, keepdims=True)
    unit = normal / speed
    values, weights = modes.values(len(markers)), modes.weights(len(markers))
    cells = retraction_at(lattice, markers, unit)
    compliance = reynolds * mean_step(lattice) * (cells / speed)[:, 0]
    law = slip_law(values, unit, weights * compliance)
    return Wall(markers, values, weights, normal, law)


@functools.partial(jax.jit, inline=True)
def outward(markers: Float[AnyArray, "nodes 2"]) -> Float[AnyArray, "nodes 2"]:
    """Return the outward normal times ds/dt of a clockwise contour given at equidistant t."""
    nodes = markers.shape[0]
    wave = np.fft.fftfreq(nodes, 1 / nodes)
    wave[nodes // 2] = 0.0
    tangent = jnp.fft.ifft(1j * wave[:, None] * jnp.fft.fft(markers, axis=0), axis=0).real
    return jnp.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
