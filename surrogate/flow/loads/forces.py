"""Force coefficients and surface loads of a solved flow."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import outward
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes import Modes, SpaceModes

PROBES = (2.5, 3.5, 4.5)  # cells off the wall, clear of the smeared traction


class Coefficients(NamedTuple):
    """Force of the fluid on the body over (1/2) rho U^2 D, per unit span; in space pi D^2 / 4.

    ``moment`` is about the origin (the centroid), nose up, over (1/2) rho U^2 D^2.
    """

    drag: Float[AnyArray, ""]
    drag_pressure: Float[AnyArray, ""]
    drag_friction: Float[AnyArray, ""]
    lift: Float[AnyArray, ""]
    moment: Float[AnyArray, ""]


def drag_coefficient(amplitude: Float[AnyArray, " modes"]) -> Float[AnyArray, ""]:
    """Cd = 2 F_x: the zeroth mode is the force on the fluid, hence the sign."""
    return -2 * amplitude[0]


def lift_coefficient(
    modes: Modes | SpaceModes, amplitude: Float[AnyArray, " modes"]
) -> Float[AnyArray, ""]:
    """Cl = 2 F_y; nought of bodies with a mirror plane along the stream."""
    return jnp.zeros(()) if modes.lift_index is None else -2 * amplitude[modes.lift_index]


def coefficients(
    domain: Domain,
    markers: Float[AnyArray, "nodes 2"],
    velocity: Float[AnyArray, "2 nx ny"],
    amplitude: Float[AnyArray, " modes"],
    reynolds: Float[AnyArray, ""],
) -> Coefficients:
    """Drag and lift from the zeroth modes; friction from the wall vorticity, pressure the rest.

    The traction modes themselves do not split: the smeared layer carries part of the pressure
    gradient along the wall as a tangential force, an error of first order in h.
    """
    modes = domain.modes
    drag = drag_coefficient(amplitude)
    lift = lift_coefficient(modes, amplitude)
    unit, speed = _frame(markers)
    shear = friction_coefficient(domain, markers, velocity, reynolds)
    friction = 2 * jnp.pi * jnp.mean(shear * unit[:, 1] * speed)
    force = _traction(domain, markers, amplitude)
    moment = jnp.mean(markers[:, 1] * force[:, 0] - markers[:, 0] * force[:, 1]) * 2 * jnp.pi
    return Coefficients(drag, drag - friction, friction, lift, 2 * moment)


def friction_coefficient(
    domain: Domain,
    markers: Float[AnyArray, "nodes 2"],
    velocity: Float[AnyArray, "2 nx ny"],
    reynolds: Float[AnyArray, ""],
) -> Float[AnyArray, " nodes"]:
    """Cf along the clockwise contour, 2 nu times the vorticity, extrapolated to the wall."""
    unit, _ = _frame(markers)
    h = domain.lattice.step[0]
    lattice = domain.lattice.unfolded
    field = vorticity(lattice, domain.lattice.unfold(velocity))
    probed = [_interpolate(lattice, domain.box, field, markers + k * h * unit) for k in PROBES]
    weights = np.linalg.solve(np.vander(PROBES, increasing=True).T, np.eye(len(PROBES))[0])
    return -2 / reynolds * sum(w * values for w, values in zip(weights, probed, strict=True))


def vorticity(lattice: Lattice, velocity: Float[AnyArray, "2 nx ny"]) -> Float[AnyArray, "nx ny"]:
    """dv/dx - du/dy at the upper right corner of every cell."""
    u, v = velocity
    dx, dy = lattice.step
    return (jnp.roll(v, -1, axis=0) - v) / dx - (jnp.roll(u, -1, axis=1) - u) / dy


def _traction(domain, markers, amplitude):
    """Force of the fluid on the body per unit t."""
    return -jnp.tensordot(amplitude, domain.modes.values(markers.shape[0]), axes=1).T


def _frame(markers):
    normal = outward(markers)
    speed = jnp.linalg.norm(normal, axis=1)
    return normal / speed[:, None], speed


def _interpolate(lattice, box, corner_field, points):
    """Cubic convolution (Keys 1981) of a corner field on the body's surroundings."""
    margin = 6
    (x, _), (_, y) = lattice.faces()
    i0, j0 = lattice.inlet - box[0] // 2, lattice.shape[1] // 2 - box[1] // 2
    i = slice(max(i0 - margin, 0), i0 + box[0] + margin)
    j = slice(max(j0 - margin, 0), j0 + box[1] + margin)
    wx = keys_weights((points[:, :1] - x[i]) / lattice.step[0])
    wy = keys_weights((points[:, 1:] - y[j]) / lattice.step[1])
    return jnp.einsum("ki,ij,kj->k", wx, corner_field[i, j], wy, optimize="optimal")


def keys_weights(r: Float[AnyArray, "..."]) -> Float[AnyArray, "..."]:
    """Of a field's values at distances r, in cells, in a cubic convolution (Keys 1981)."""
    a = jnp.abs(r)
    near = 1 + a**2 * (1.5 * a - 2.5)
    far = 2 + a * (-4 + a * (2.5 - 0.5 * a))
    return jnp.where(a < 1, near, jnp.where(a < 2, far, 0.0))
