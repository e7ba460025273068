"""The free fall of a body in its plane of symmetry, with the loads of a surrogate.

With lengths in D and velocities in nu / D the speed is the Reynolds number R. The axis e of the
body, tail to nose, is ``tilt`` above the horizontal; the body moves with the velocity v at the
incidence alpha, from e to v. Its momentum P and its angular velocity omega follow

    dP/dt = (pi/8) R (-Cd v + Cl w) - (pi/6) (s - 1) N z,    d tilt/dt = omega,
    v = (P.e) / (m + m_e) e + (P.n) / (m + m_n) n,
    (J + J') d omega/dt = -(pi/8) R^2 Cm - K omega,

with w = -v turned by +90 degrees, the upward unit vector z, n = e turned by +90 degrees, the
density ratio s, which is uniform in the body, N = g D^3 / nu^2, mass and inertia m and J, and added
masses m_e and m_n, added inertia J' and Stokes resistance to rotation K of the equivalent
ellipsoid: that of the same volume, aspect and flatness, its sine modes left out. The loads are
those of steady motion at the momentary incidence and R, its torque included. Left out are what
rotation does to drag and lift, the memory of the flow, and inertia in the resistance to rotation.

Below the least Re of the surrogate, R0, drag and lift follow Oseen's correction of Stokes flow
(Brenner and Cox 1963): Cd R = A (1 + A R / 128) and Cl R = B (1 + 5 A R / 256), up to terms of B^2
and with equal resistances along and across the stream in the correction; A and B are those with
which R0 has the surrogate's loads. Cm is split: the part that is odd in the even sine modes is that
of Stokes flow, of which Cm R is kept; the even part is by inertia, of which Cm is kept.
"""

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.integrate import solve_ivp

from shapeopt.problem.scenarios import LoadModel
from surrogate.arrays import AnyArray, Body, Number
from surrogate.body.body_class import BodyClass
from surrogate.body.ellipsoid import DISPLACED, equivalent_ellipsoid
from surrogate.body.incidence import in_first_quarter, reversal
from surrogate.body.parameters import INCIDENCE
from surrogate.checks import LARGEST, SMALLEST, expect, finite_number
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.settling import Particle
from surrogate.model.surrogate import Surrogate

TOLERANCE = 1e-8  # relative, of the integration in time
SAMPLES = 400  # in time, that a fall is reported at
SLOWEST = 1e-30  # Re, for which a body at rest is taken
SLOW = 1.0  # Re, the least of a surrogate below which a fall may end by Oseen's correction


@dataclasses.dataclass(frozen=True, eq=False)
class Fall:
    """The motion of a body that falls or rises, in SI units, from rest at the origin.

    Attributes:
      time: in s.
      x: horizontal position in m.
      z: height in m.
      tilt: of the axis, tail to nose, above the horizontal, in degrees; it may exceed 180.
      velocity: horizontal and upward, in m/s.
      incidence: from the axis to the velocity, -180 to 180 degrees.
      reynolds: by the speed.
    """

    time: Float[np.ndarray, " times"]
    x: Float[np.ndarray, " times"]
    z: Float[np.ndarray, " times"]
    tilt: Float[np.ndarray, " times"]
    velocity: Float[np.ndarray, "times 2"]
    incidence: Float[np.ndarray, " times"]
    reynolds: Float[np.ndarray, " times"]

    def __repr__(self) -> str:
        u, w = self.velocity[-1]
        return (
            f"Fall(after {self.time[-1]:.4g} s at Re {self.reynolds[-1]:.4g}, velocity "
            f"{u:.4g}, {w:.4g} m/s, tilt {self.tilt[-1]:.1f} degrees)"
        )


def fall(
    surrogate: Surrogate,
    parameters: Body,
    particle: Particle,
    seconds: float = 1.0,
    tilt: float = 45.0,
) -> Fall:
    """Integrate the free fall of a body from rest in its plane of symmetry.

    An incidence among the parameters is ignored; ``tilt`` is the orientation at the start.

    Args:
      surrogate: of 3-D bodies at incidences from 0 to 90 degrees.
      parameters: of the body, in the order of ``surrogate.scene.family.names``, or by name.
      particle: density ratio, viscosity, size and gravity.
      seconds: duration (1).
      tilt: of the axis above the horizontal at the start, from -360 to 360 degrees (45).

    Returns:
      The motion at ``SAMPLES`` times from 0 to ``seconds``, evenly spaced.

    Raises:
      InvalidInput: an argument is invalid, the body becomes faster than the trained range, or it
        ends below that range, which begins above Re 1.
      NotConverged: the integration in time fails.
    """
    body = checked_body(surrogate, parameters)
    expect("particle", particle, Particle, "Particle")
    seconds, tilt = finite_number("seconds", seconds), finite_number("tilt", tilt)
    if not seconds > 0:
        raise InvalidInput(f"seconds {seconds:g}: a duration above 0")
    unit = particle.size**2 / particle.viscosity
    if not SMALLEST <= seconds / unit <= LARGEST:
        ends = f"from {SMALLEST * unit:.3g} to {LARGEST * unit:.3g}"
        raise InvalidInput(f"seconds {seconds:g}: {ends} for a particle of this size")
    if not abs(tilt) <= 360:
        raise InvalidInput(f"tilt {tilt:g}: from -360 to 360 degrees")
    constants, fastest = constants_of(surrogate, body, particle), surrogate.scene.reynolds[1]

    network, body_class = surrogate.network, surrogate.scene.family.body_class

    def rates(_, state):
        return np.asarray(rates_of(network, body_class, body, constants, state))

    def too_fast(_, state):
        return fastest * (1 + 1e-6) - float(np.hypot(*_velocity(constants, state)))

    too_fast.terminal = True
    times = np.linspace(0, seconds / unit, SAMPLES)
    start = np.array([0, 0, math.radians(tilt), 0, 0, 0.0])
    found = solve_ivp(
        *(rates, (0, times[-1]), start, "LSODA", times),
        **{"events": too_fast, "rtol": TOLERANCE, "atol": TOLERANCE * scales_of(constants)},
    )
    if found.t_events[0].size:
        raise InvalidInput(
            f"fall: after {unit * found.t_events[0][0]:.3g} s it exceeds Re {fastest:g}, up to "
            f"which the surrogate was trained; a smaller size would do ({particle.described})"
        )
    if not found.success:
        raise NotConverged(f"fall: the integration in time failed: {found.message}")
    velocity = np.asarray(_velocity(constants, found.y)).T
    last = float(np.hypot(*velocity[-1]))
    if last < surrogate.scene.reynolds[0] > SLOW:
        raise InvalidInput(
            f"fall: it ends at Re {last:.3g}, below Re {surrogate.scene.reynolds[0]:g}, from which "
            f"the surrogate was trained; Oseen's correction goes on from Re {SLOW:g} at most"
        )
    angle = np.arctan2(velocity[:, 1], velocity[:, 0]) - found.y[2]
    angle[0] = angle[1]  # at rest there is none
    return Fall(
        time=unit * found.t,
        x=particle.size * found.y[0],
        z=particle.size * found.y[1],
        tilt=np.rad2deg(found.y[2]),
        velocity=particle.viscosity / particle.size * velocity,
        incidence=(np.rad2deg(angle) + 180) % 360 - 180,
        reynolds=np.hypot(*velocity.T),
    )


def checked_body(surrogate: Surrogate, parameters: Body) -> Float[np.ndarray, " parameters"]:
    """Return the parameters of a body at incidence 0, after checking the surrogate and the body.

    Raises:
      InvalidInput: the surrogate is not of 3-D bodies at incidences from 0 to 90 degrees, or the
        body is outside its trained ranges, as it is or with nose and tail exchanged.
    """
    expect("surrogate", surrogate, Surrogate, "Surrogate")
    family = surrogate.scene.family
    low, high = dict(family.ranges).get(INCIDENCE.name, (1, 0))
    if family.dimension != 3 or low > 0 or high < 90:
        raise InvalidInput(
            "surrogate: of 3-D bodies at incidences from 0 to 90 degrees, as pretrained:particle"
        )
    body = family.body_class.replaced(family.numbers(parameters), INCIDENCE.name, 0.0)
    least = np.array(surrogate.scene.reynolds[0])
    surrogate.loads(body, least)  # refuses bodies outside the ranges
    if outside := surrogate.ranges.outside(reversal(family.body_class.parameters) * body, least):
        raise InvalidInput(
            f"body: moves tail first too, and is then outside the trained ranges: {outside}"
        )
    return body


@functools.partial(jax.jit, static_argnums=1)
def loads_at(
    network: LoadModel,
    body_class: BodyClass,
    body: Float[AnyArray, " parameters"],
    angle: Number,
    reynolds: Number,
) -> Float[Array, "3"]:
    """Return Cd, Cl and Cm of a body that moves steadily at any angle to its axis.

    Args:
      network: of the surrogate.
      body_class: of the surrogate's family, of 3-D bodies at incidence.
      body: its parameters; the incidence among them is replaced.
      angle: from the axis to the velocity, in radians.
      reynolds: by the speed, within the trained range.
    """
    turned = body_class.replaced(body, INCIDENCE.name, jnp.rad2deg(angle))
    nearest, image = in_first_quarter(body_class.parameters, turned)
    return network.loads(nearest, reynolds) * jnp.stack([jnp.ones(()), image, image])


def constants_of(
    surrogate: Surrogate, body: Float[np.ndarray, " parameters"], particle: Particle
) -> Float[np.ndarray, "6"]:
    """Return the six constants of the equations of motion, with lengths in D and time in D^2 / nu.

    They are the masses along and across the axis and the inertia, each with the added one, the
    resistance to rotation K, the weight less buoyancy (pi/6) (s - 1) N, and the least Re of the
    surrogate.
    """
    body_class, s = surrogate.scene.family.body_class, particle.density_ratio
    aspect, flatness = (float(f(body)) for f in (body_class.aspect, body_class.flatness))
    ellipsoid = equivalent_ellipsoid(aspect, flatness)
    along, across = (s * DISPLACED + added for added in ellipsoid.added_masses)
    weight = DISPLACED * math.copysign(particle.archimedes, s - 1)
    inertia = s * ellipsoid.inertia + ellipsoid.added_inertia
    resistance, slowest = ellipsoid.resistance_to_rotation, surrogate.scene.reynolds[0]
    return np.array([along, across, inertia, resistance, weight, slowest])


def scales_of(constants: Float[np.ndarray, "6"]) -> Float[np.ndarray, "6"]:
    """Return the scales of position, tilt, momentum and angular velocity, for absolute tolerances.

    They are D, one radian, and the momentum and angular velocity of the body at the Re at which a
    sphere of its weight settles in Stokes flow; each is 1 at most.

    Args:
      constants: as ``constants_of`` returns them.
    """
    along, across, _, _, weight, _ = constants
    speed = min(abs(weight) / (3 * math.pi), 1.0)
    return np.minimum([1, 1, 1, along * speed, across * speed, speed], 1.0)


def axes_of(tilt: Number) -> tuple[Float[Array, "2 ..."], Float[Array, "2 ..."]]:
    """Return the unit vectors along the body's axis, tail to nose, and across it (+90 degrees)."""
    c, s = jnp.cos(tilt), jnp.sin(tilt)
    return jnp.stack([c, s]), jnp.stack([-s, c])


@jax.jit
def _velocity(constants, state):
    """Return the velocity (2, ...) at states (6, ...), of which ``rates_of`` has the order."""
    axis, normal = axes_of(state[2])
    along, across = (jnp.sum(state[3:5] * e, axis=0) for e in (axis, normal))
    return along / constants[0] * axis + across / constants[1] * normal


@functools.partial(jax.jit, static_argnums=1)
def rates_of(
    network: LoadModel,
    body_class: BodyClass,
    body: Float[AnyArray, " parameters"],
    constants: Float[AnyArray, "6"],
    state: Float[AnyArray, "6"],
) -> Float[Array, "6"]:
    """Return the time derivatives of position, tilt, momentum and angular velocity.

    Args:
      network: of the surrogate, which answers the loads.
      body_class: of the surrogate's family.
      body: parameters at incidence 0.
      constants: as ``constants_of`` returns them.
      state: of shape (6,): x and z, tilt in radians, the two components of the momentum, and the
        angular velocity.
    """
    _, _, inertia, resistance, weight, slowest = constants
    velocity, (axis, normal) = _velocity(constants, state), axes_of(state[2])
    speed = jnp.sqrt(velocity @ velocity + SLOWEST**2)
    angle = jnp.arctan2(velocity @ normal, velocity @ axis + SLOWEST)
    known = jnp.maximum(speed, slowest)
    backward = reversal(body_class.parameters) * body
    drag, lift, moment = loads_at(network, body_class, body, angle, known)
    by_stokes = (moment - loads_at(network, body_class, backward, angle, known)[2]) / 2
    moment = known * by_stokes + speed * (moment - by_stokes)
    stream = -velocity / speed
    upward = jnp.stack([-stream[1], stream[0]])
    along, across = _oseen_factors(drag, known, speed)
    force = jnp.pi / 8 * speed * known * (along * drag * stream + across * lift * upward)
    torque = -jnp.pi / 8 * speed * moment - resistance * state[5]
    gravity = jnp.stack([jnp.zeros(()), -weight])
    return jnp.concatenate([velocity, state[5:], force + gravity, jnp.stack([torque / inertia])])


def _oseen_factors(drag, known, reynolds):
    """Return the ratios of Cd Re and of Cl Re at a Reynolds number to those at a known one."""
    stokes = 2 * known * drag / (1 + jnp.sqrt(1 + known * drag * known / 32))  # A

    def ratio(share):
        return (1 + share * stokes * reynolds) / (1 + share * stokes * known)

    return ratio(1 / 128), ratio(5 / 256)
