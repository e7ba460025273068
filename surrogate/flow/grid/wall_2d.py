"""Wall treatment in 2-D: retraction to second order in the cell size, or a slip law on the wall."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.measures import moments
from surrogate.flow.grid.immersed import Wall, slip_law
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes_2d import Modes2D
from surrogate.flow.grid.retraction import mean_step, retract


def wall_2d(
    lattice: Lattice,
    modes: Modes2D,
    markers: Float[AnyArray, "nodes 2"],
    reynolds: Float[AnyArray, ""] | float,
    slip_share: float,
) -> Wall:
    """Return the discretised wall of a 2-D body, with slip law and retraction by their shares.

    Args:
      lattice: the grid.
      modes: traction modes.
      markers: of the contour at equidistant t, clockwise from the nose, in D.
      reynolds: U D / nu.
      slip_share: share of the slip law, 0 to 1; markers are retracted by the rest.
    """
    normal = outward(markers)
    speed = jnp.linalg.norm(normal, axis=1, keepdims=True)
    unit, second = normal / speed, _second_order(markers, speed)
    points, cells = retract(lattice, markers, unit, second, 1 - slip_share)
    values, weights = modes.values(len(markers)), modes.weights(len(markers))
    law = jnp.zeros((1, 1))
    if slip_share > 0:
        compliance = slip_share * reynolds * mean_step(lattice) * (cells / speed)[:, 0]
        law = slip_law(values, unit, weights * compliance)
    return Wall(points, values, weights, normal, law)


@functools.partial(jax.jit, inline=True)
def outward(markers: Float[AnyArray, "nodes 2"]) -> Float[AnyArray, "nodes 2"]:
    """Return the outward normal times ds/dt of a clockwise contour given at equidistant t."""
    nodes = markers.shape[0]
    wave = np.fft.fftfreq(nodes, 1 / nodes)
    wave[nodes // 2] = 0.0
    tangent = jnp.fft.ifft(1j * wave[:, None] * jnp.fft.fft(markers, axis=0), axis=0).real
    return jnp.stack([-tangent[:, 1], tangent[:, 0]], axis=1)


def _second_order(markers, speed):
    """Return the second-order coefficient c of the retraction, per D.

    The sheet drags the fluid inside the body along at -shear R h. That fluid recirculates (Stokes
    flow in a disc of radius l, or a slab of half width l: its shear is 3 / l of its wall speed),
    which lowers the jump of the shear across the wall. l = 2 area / perimeter is exact for the
    disc; for slender bodies it is up to 1.6 times the half thickness.
    """
    return 3 * np.pi * jnp.mean(speed) / moments(markers)[0]
