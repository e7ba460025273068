"""Loads as differentiable functionals J(modes, amplitude, markers) of a solved flow.

A load is any function of the traction amplitudes and of the body's markers. Its value, the
right-hand side of its adjoint (its derivative in the amplitudes) and its explicit derivative in
the markers all come from this one function, so a new load is one more function here. Coefficients
are over U = D = rho = 1: 2 F and 2 M per unit span in 2-D, 8 F / pi in 3-D.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.grid.modes_2d import Modes2D
from surrogate.flow.grid.modes_3d import Modes3D


class Coefficients(NamedTuple):
    """Force of the fluid on the body over (1/2) rho U^2 D per unit span; in 3-D over pi D^2 / 4.

    ``moment`` is about the centroid, positive nose up, over (1/2) rho U^2 D^2.
    """

    drag: Float[AnyArray, ""]
    drag_pressure: Float[AnyArray, ""]
    drag_friction: Float[AnyArray, ""]
    lift: Float[AnyArray, ""]
    moment: Float[AnyArray, ""]


AnyModes = Modes2D | Modes3D
Load = Callable[[AnyModes, Array, Markers], Array]


def drag_coefficient(
    amplitude: Float[AnyArray, "*bodies modes"],
) -> Float[AnyArray, "*bodies"]:
    """Return Cd = -2 a_0: a_0 is the force on the fluid along the stream, hence the sign."""
    return -2 * amplitude[..., 0]


def drag_amplitude(drag: Float[AnyArray, "..."]) -> Float[AnyArray, "..."]:
    """Return a_0 of a drag coefficient, the inverse of ``drag_coefficient``."""
    return drag / -2


def drag(
    modes: AnyModes, amplitude: Float[AnyArray, " modes"], markers: Markers
) -> Float[AnyArray, ""]:
    """Return the drag coefficient Cd."""
    return drag_coefficient(amplitude)


def lift(
    modes: AnyModes, amplitude: Float[AnyArray, " modes"], markers: Markers
) -> Float[AnyArray, ""]:
    """Return the lift coefficient Cl, positive along y; 0 where y = 0 is a mirror plane."""
    return jnp.zeros(()) if modes.lift_index is None else -2 * amplitude[modes.lift_index]


def moment(
    modes: AnyModes, amplitude: Float[AnyArray, " modes"], markers: Markers
) -> Float[AnyArray, ""]:
    """Return the moment coefficient Cm about the origin (the centroid), positive nose up.

    0 where y = 0 is a mirror plane.
    """
    if modes.lift_index is None:
        return jnp.zeros(())
    force = traction(modes, amplitude, len(markers))
    return 4 * np.pi * jnp.mean(markers[:, 1] * force[:, 0] - markers[:, 0] * force[:, 1])


LOADS: dict[str, Load] = {"cd": drag, "cl": lift, "cm": moment}


def traction(
    modes: Modes2D, amplitude: Float[AnyArray, " modes"], nodes: int
) -> Float[Array, "nodes 2"]:
    """Return the force of the fluid on the body per unit t, at equidistant t of the contour."""
    return -jnp.tensordot(amplitude, modes.values(nodes), axes=1).T
