"""The small swings of spheroids that fall through a gas, by a model with correlations of the loads.

The model is that of a Python file (see ``correlations_at_incidence``) that cites Bhowmick et al.
(Phys. Rev. Lett. 132, 034101, 2024), of which the abstract alone was at hand. With lengths in D,
velocities in nu / D and forces in rho nu^2,

    F = -K v - c |v| (3 K - v.K v / |v|^2) K v,    T = -(pi/4) m (e.v) (e x v) - k omega,

with the Stokes resistances K along and across the axis e and k to rotation. The constant c gives
the drag of the correlation at the steady fall, m is the correlation's moment there at 45 degrees.
Added masses are left out, so it is for bodies far denser than the fluid.
"""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from correlations import ellipsoid, stokes_force
from correlations_at_incidence import Inclined, froehlich, ouchene
from jaxtyping import Array, Float
from scipy.optimize import brentq

from surrogate import Particle
from surrogate.arrays import AnyArray
from surrogate.body.ellipsoid import DISPLACED, equivalent_ellipsoid

RANGE = 1.0, 100.0  # Re of the correlations


def small_swings_by_correlations(aspect: float, particle: Particle) -> tuple[float, float, float]:
    """Return Re of the steady broadside fall, and frequency (Hz) and decay (1/s) of small swings.

    Args:
      aspect: length over thickness of the spheroid.
      particle: its size and density, and the fluid's viscosity.
    """
    correlation, stable = (froehlich, 90.0) if aspect > 1 else (ouchene, 0.0)
    weight = DISPLACED * particle.archimedes

    def excess(reynolds):
        drag = correlation(Inclined(aspect, incidence=stable), reynolds).cd
        return math.pi / 8 * drag * reynolds**2 - weight

    speed = brentq(excess, *RANGE)
    given = {"aspect": aspect, "density": particle.density_ratio, "weight": weight, "speed": speed}
    given |= {"moment": correlation(Inclined(aspect, incidence=45.0), speed).cm}
    steady = jnp.array([0.0, -speed, math.radians(90.0 - stable), 0.0])
    change = jax.jacfwd(functools.partial(accelerations, **given))(steady)
    roots = np.linalg.eigvals(np.asarray(change)) * particle.viscosity / particle.size**2
    swing = max(roots[roots.imag > 0], key=lambda root: root.real)
    return speed, float(swing.imag) / (2 * math.pi), -float(swing.real)


def accelerations(
    state: Float[AnyArray, " 4"],
    aspect: float,
    density: float,
    weight: float,
    speed: float,
    moment: float,
) -> Float[Array, " 4"]:
    """Return the rates of horizontal and upward velocity, tilt of the axis and angular velocity.

    Args:
      state: these four, the tilt in radians above the horizontal.
      aspect: length over thickness of the spheroid.
      density: density over that of the fluid.
      weight: weight less the buoyancy, over rho nu^2.
      speed: Reynolds number of the steady fall.
      moment: Cm at 45 degrees.
    """
    velocity, tilt, turning = state[:2], state[2], state[3]
    spheroid = ellipsoid(aspect)
    along, across = stokes_force(spheroid), stokes_force(spheroid.turned)
    broadside = across if aspect > 1 else along
    inertia = (weight / (broadside * speed) - 1) / (2 * broadside * speed)
    axis = jnp.stack([jnp.cos(tilt), jnp.sin(tilt)])
    stokes = across * velocity + (along - across) * (axis @ velocity) * axis
    twice = across * stokes + (along - across) * (axis @ stokes) * axis
    square = velocity @ velocity
    force = -stokes - inertia * jnp.sqrt(square) * (3 * twice - velocity @ stokes / square * stokes)
    force -= weight * jnp.array([0.0, 1.0])
    body = equivalent_ellipsoid(aspect)
    sideways = axis[0] * velocity[1] - axis[1] * velocity[0]
    torque = -math.pi / 4 * moment * (axis @ velocity) * sideways
    torque -= body.resistance_to_rotation * turning
    rates = force / (density * DISPLACED), jnp.stack([turning, torque / (density * body.inertia)])
    return jnp.concatenate(rates)
