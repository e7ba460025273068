"""How a body lies when it falls: incidences without torque, and swings about steady motion."""

import dataclasses
import functools
import math
from typing import NamedTuple

import jax
import numpy as np
from scipy.optimize import brentq

from shapeopt.free_fall import Fall, axes_of, checked_body, constants_of, loads_at, rates_of
from surrogate.arrays import Body
from surrogate.body.parameters import INCIDENCE
from surrogate.flow.settling import Particle
from surrogate.model.surrogate import Surrogate

SCAN = 181  # angles at which the torque is sampled
LEVEL = 1e-9  # moment over drag below which there is none
REAL = 1e-9  # imaginary part over magnitude of a root, below which nothing swings


@dataclasses.dataclass(frozen=True)
class Orientation:
    """An incidence at which a body in steady motion has no torque.

    Attributes:
      incidence: in degrees, 0 to 180.
      stable: whether the torque turns the body back to it.
    """

    incidence: float
    stable: bool


def orientations(surrogate: Surrogate, parameters: Body, reynolds: float) -> list[Orientation]:
    """Return the incidences without torque from 0 to 180 degrees, and which are stable.

    A nose-up moment increases the incidence of a body that moves straight on, so that an incidence
    is stable where the moment falls with it. Of bodies that are nearly round they are those of the
    surrogate's error; ``moment_is_known`` tells.

    Args:
      surrogate: as for ``shapeopt.fall``.
      parameters: likewise.
      reynolds: Reynolds number of the motion.

    Raises:
      InvalidInput: an argument is invalid or outside the trained ranges.
    """
    body, body_class = checked_body(surrogate, parameters), surrogate.scene.family.body_class
    reynolds = surrogate.scene.check_reynolds(reynolds)

    def moment(degrees):
        loads = loads_at(surrogate.network, body_class, body, np.deg2rad(degrees), reynolds)
        return float(loads[2] / loads[0])

    angles = np.linspace(0, 180, SCAN)
    moments = np.array([moment(angle) for angle in angles])
    found = [Orientation(0.0, moment(0.5) < 0)] if abs(moments[0]) < LEVEL else []
    for k in range(1, SCAN - 1):
        falls = moments[k - 1] > moments[k + 1]
        if abs(moments[k]) < LEVEL:
            found.append(Orientation(float(angles[k]), bool(falls)))
        elif moments[k] * moments[k + 1] < 0 and min(abs(moments[k : k + 2])) >= LEVEL:
            at = brentq(moment, angles[k], angles[k + 1], xtol=1e-9)
            found.append(Orientation(float(at), bool(moments[k] > 0)))
    return [*found, Orientation(180.0, moment(179.5) > 0)] if abs(moments[-1]) < LEVEL else found


def moment_is_known(surrogate: Surrogate, parameters: Body, reynolds: float) -> bool:
    """Return whether the largest moment of all incidences exceeds the largest bound of its error.

    If not, as for bodies that are nearly round, orientations by the surrogate mean nothing. True
    where no bounds are known, as for surrogates of older trainings.

    Args:
      surrogate: as for ``shapeopt.fall``.
      parameters: likewise.
      reynolds: Reynolds number of the motion.

    Raises:
      InvalidInput: an argument is invalid or outside the trained ranges.
    """
    if "moment_error_scale" not in surrogate.record:
        return True
    body, angles = checked_body(surrogate, parameters), np.linspace(0, 180, SCAN)
    bodies = surrogate.scene.family.body_class.replaced(body, INCIDENCE.name, angles)
    loads = np.asarray(surrogate.loads(bodies, reynolds))
    bounds = surrogate.error_bounds(bodies, reynolds)
    return bool(np.max(np.abs(loads[:, 2]) / loads[:, 0]) > np.max(bounds[:, 2]))


class Swing(NamedTuple):
    """How a small disturbance of steady motion decays.

    Attributes:
      frequency: in Hz, of the disturbance that grows fastest, or if none grows of the least damped
        swing; None where this disturbance does not swing.
      decay_rate: of the same disturbance, in 1/s, negative if it grows; where nothing grows or
        swings, of the slowest one.
    """

    frequency: float | None
    decay_rate: float


def small_swings(surrogate: Surrogate, parameters: Body, particle: Particle, found: Fall) -> Swing:
    """Return how a small disturbance of the motion at the end of a fall decays.

    Args:
      surrogate: as for ``shapeopt.fall``.
      parameters: likewise.
      particle: likewise.
      found: a fall of this body that ends in steady motion.
    """
    body = checked_body(surrogate, parameters)
    constants, tilt = constants_of(surrogate, body, particle), math.radians(found.tilt[-1])
    velocity = particle.size / particle.viscosity * found.velocity[-1]
    axes = [np.asarray(axis) for axis in axes_of(tilt)]
    momentum = sum(m * (velocity @ e) * e for m, e in zip(constants[:2], axes, strict=True))
    state = np.concatenate([[0, 0, tilt], momentum, [0]])
    rates = functools.partial(rates_of, surrogate.network, surrogate.scene.family.body_class)
    change = np.asarray(jax.jacobian(lambda y: rates(body, constants, y)[2:])(state))[:, 2:]
    roots = np.linalg.eigvals(change) * particle.viscosity / particle.size**2
    swings = roots[np.abs(roots.imag) > REAL * np.abs(roots)]
    growing = roots[roots.real > 0]  # the fall is unstable, whether or not it swings as well
    shown = growing if len(growing) else swings if len(swings) else roots
    slowest = max(shown, key=lambda root: root.real)
    frequency = abs(slowest.imag) / (2 * math.pi) if slowest in swings else None
    return Swing(frequency, float(-slowest.real))
