"""The terminal velocity of a particle: the Re at which the flow's force balances its weight."""

import dataclasses
import math
from typing import NamedTuple

from scipy.optimize import brentq

from surrogate.body.shape import Shape
from surrogate.checks import SMALLEST, expect, physical_number
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.flow import Flow
from surrogate.flow.solution import Solution
from surrogate.scene.limits import ONSET_OF_INSTABILITY, REYNOLDS, onset_of

BALANCED = 1e-4  # relative difference of drag and weight
MAX_FLOWS = 12
HOPELESS = 10  # times the onset: where the sphere settles so fast, the flattest disc is too fast
RANGE = REYNOLDS[3][0], ONSET_OF_INSTABILITY[3]  # of Re, in which bodies are solved
LOG_RE = -200.0, 200.0  # between which the sphere's correlation is inverted; of all particles


@dataclasses.dataclass(frozen=True)
class Particle:
    """A body in a fluid at rest, with its numbers in SI units.

    Args:
      density_ratio: density over the fluid's.
      viscosity: the fluid's kinematic viscosity, m^2/s.
      size: diameter of the sphere of the body's volume, m.
      gravity: m/s^2.

    Raises:
      InvalidInput: a number is not positive, or the body neither falls nor rises.
    """

    density_ratio: float
    viscosity: float
    size: float
    gravity: float = 9.81

    def __post_init__(self):
        for field in dataclasses.fields(self):
            value = physical_number(field.name.replace("_", " "), getattr(self, field.name))
            object.__setattr__(self, field.name, value)
        if abs(self.density_ratio - 1) < SMALLEST:
            raise InvalidInput("density ratio 1: such a body neither falls nor rises")

    @property
    def archimedes(self) -> float:
        """The Archimedes number |density ratio - 1| g D^3 / nu^2."""
        weight = abs(self.density_ratio - 1) * self.gravity
        return weight * self.size**3 / self.viscosity**2

    @property
    def described(self) -> str:
        """Density ratio and size in words, for messages on particles that are too fast."""
        return f"{self.density_ratio:g} times as dense as the fluid, {self.size:g} m"

    def velocity(self, reynolds: float) -> float:
        """Return the velocity in m/s of the particle at a Reynolds number."""
        return reynolds * self.viscosity / self.size


class Settled(NamedTuple):
    """A particle that moves steadily: its speed along its path in m/s and its Re.

    The vertical velocity is the speed times the cosine of ``drift``. ``flows`` is the number of
    flows that were solved for the balance of forces, ``solution`` the last; below Re 0.001 that at
    0.001, where Cd Re is the same.
    """

    velocity: float
    reynolds: float
    solution: Solution
    flows: int

    @property
    def drift(self) -> float:
        """The angle between motion and gravity in degrees, of a body held at its incidence."""
        return math.degrees(math.atan2(self.solution.lift, self.solution.drag))


def settle(flow: Flow, shape: Shape, particle: Particle, estimate: bool = True) -> Settled:
    """Return the steady fall or rise of a body, where the flow's force balances its weight.

    The balance is sqrt(Cd^2 + Cl^2) Re^2 = 4/3 Archimedes number, with buoyancy in the latter. The
    body is held at its incidence, the angle between its axis and its motion; with lift it drifts
    sideways as it falls.
    The secant method in logarithms starts from the sphere's correlation (Schiller and Naumann
    1933). Particles slower than the solver's least Re are in Stokes flow, where Cd Re is constant.
    A free body turns its broad side to its motion, by inertia (Khayat and Cox 1989): that incidence
    is the body's own to give; ``shapeopt.fall`` follows the turning.

    Args:
      flow: of a 3-D scene.
      shape: the body, in any size; the particle's size replaces it.
      particle: density ratio, viscosity, size and gravity.
      estimate: estimate the error of the last flow.

    Raises:
      InvalidInput: the body is 2-D, or moves too fast for a steady flow.
      NotConverged: a flow did not converge, or drag and weight did not balance.
    """
    expect("settling", flow, Flow, "Flow; shapeopt.fall takes surrogates")
    expect("settling", shape, Shape, "Shape; family_shape(..., dimension=3) makes one")
    expect("settling", particle, Particle, "Particle(density_ratio, viscosity, size)")
    if shape.dimension != 3:
        raise InvalidInput("settling: is for 3-D bodies, dimension 3")
    goal = math.log(4 / 3 * particle.archimedes)
    re = sphere_reynolds(particle.archimedes)
    slope = (_log_sphere_thrust(math.log(1.01 * re)) - goal) / math.log(1.01)
    slowest, fastest = RANGE[0], onset_of(shape)
    too_fast = InvalidInput(
        f"settling: beyond Re {fastest:.3g}, up to which such a body's wake is stable; a smaller "
        f"size would do ({particle.described})"
    )
    if re > HOPELESS * fastest:
        raise too_fast
    before = found = None
    flows = 0
    for _ in range(MAX_FLOWS):
        re = min(re, fastest)
        at = max(re, slowest)
        if found is None or found.reynolds != at:
            found, flows = flow.solve(shape, at, estimate=False), flows + 1
        excess = math.log(math.hypot(found.drag, found.lift) * at * re) - goal
        if re == fastest and excess < 0:
            raise too_fast
        if abs(excess) <= BALANCED:
            if estimate:
                found = flow.estimated(found)
            return Settled(particle.velocity(re), re, found, flows)
        if before is not None:
            slope = (excess - before[1]) / math.log(re / before[0])
        before = re, excess
        re *= math.exp(-excess / slope)
    raise NotConverged(f"settling: drag and weight differ by {abs(excess):.1e} after {flows} flows")


def sphere_reynolds(archimedes: float) -> float:
    """Return the Re at which a sphere settles, by Schiller and Naumann's correlation of Cd."""
    goal = math.log(4 / 3 * archimedes)
    return math.exp(brentq(lambda log_re: _log_sphere_thrust(log_re) - goal, *LOG_RE))


def _log_sphere_thrust(log_re):
    """Return log Cd Re^2 of a sphere by Schiller and Naumann's correlation."""
    re = math.exp(log_re)
    return math.log(24 * re * (1 + 0.15 * re**0.687))
