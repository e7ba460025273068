"""Loads as differentiable functionals J(modes, amplitude, markers) of a solved flow.

A load is any function of the traction amplitudes and of the body's markers. Its value, the
right-hand side of its adjoint (its derivative in the amplitudes) and its explicit derivative in
the markers all come from this one function, so a new load is one more function here. Coefficients
are over U = D = rho = 1: 2 F and 2 M per unit span in 2-D, 8 F / pi and 8 M / pi in 3-D.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.skin import Skin, SkinNodes
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.grid.modes_2d import Modes2D
from surrogate.flow.grid.modes_3d import FORCE_UNIT, Modes3D


class Coefficients(NamedTuple):
    """The coefficients of the force of the fluid on the body and of its moment.

    Forces are over (1/2) rho U^2 D per unit span, in 3-D over (1/2) rho U^2 pi D^2 / 4. ``moment``
    is about the centroid, positive nose up, and over D times that.
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
    """Return the amplitude a_0 of a drag coefficient, the inverse of ``drag_coefficient``."""
    return drag / -2


def drag(
    modes: AnyModes, amplitude: Float[AnyArray, " modes"], markers: Markers
) -> Float[AnyArray, ""]:
    """Return the drag coefficient Cd, a load of a solved flow."""
    return drag_coefficient(amplitude)


def lift(
    modes: AnyModes, amplitude: Float[AnyArray, " modes"], markers: Markers
) -> Float[AnyArray, ""]:
    """Return the lift coefficient Cl, positive along y, in 3-D along z; 0 for symmetric flows."""
    return jnp.zeros(()) if modes.lift_index is None else -2 * amplitude[modes.lift_index]


def moment(
    modes: AnyModes, amplitude: Float[AnyArray, " modes"], markers: Markers
) -> Float[AnyArray, ""]:
    """Return the moment coefficient Cm about the origin (the centroid), positive nose up.

    It is 0 for symmetric flows.
    """
    if modes.lift_index is None:
        return jnp.zeros(())
    if isinstance(markers, Skin):
        points, nodes, unit = markers.points, markers.nodes, FORCE_UNIT / markers.nodes.parts
    else:
        points, nodes, unit = markers, len(markers), 1.0
    force = traction(modes, amplitude, nodes)
    torque = points[:, -1] * force[:, 0] - points[:, 0] * force[:, -1]
    return 2 / unit * jnp.sum(modes.weights(nodes) * torque)


LOADS: dict[str, Load] = {"cd": drag, "cl": lift, "cm": moment}


@functools.partial(jax.jit, static_argnums=(0, 1), inline=True)
def load_values(
    modes: AnyModes,
    loads: tuple[Load, ...],
    amplitude: Float[AnyArray, " modes"],
    markers: Markers,
) -> Float[Array, " loads"]:
    """Return the values of loads of a solved flow, by one program.

    Args:
      modes: of the traction.
      loads: functions such as ``drag``.
      amplitude: of the modes.
      markers: of the body.
    """
    return jnp.stack([load(modes, amplitude, markers) for load in loads])


def traction(
    modes: AnyModes, amplitude: Float[AnyArray, " modes"], nodes: int | SkinNodes
) -> Float[Array, "nodes axes"]:
    """Return the force of the fluid on the body at the nodes, per unit t (3-D: per mu and phi)."""
    return -jnp.tensordot(amplitude, modes.values(nodes), axes=1).T
