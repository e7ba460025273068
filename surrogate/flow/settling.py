"""How fast a particle falls or rises: the Reynolds number at which drag balances its weight."""

import dataclasses
import math
from typing import NamedTuple

from surrogate.body.shape import Shape
from surrogate.checks import expect, finite_number
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.flow import Flow
from surrogate.flow.solution import Solution
from surrogate.scene.limits import ONSET_OF_SHEDDING, REYNOLDS, onset_of_shedding

LEAST, MOST = 1e-12, 1e12  # of a particle's numbers
BALANCED = 1e-4  # relative, of drag and weight
STEPS = 12
RANGE = REYNOLDS[3][0], ONSET_OF_SHEDDING[3]


@dataclasses.dataclass(frozen=True)
class Particle:
    """A body in a fluid at rest: density over the fluid's, and sizes in metres and seconds.

    ``viscosity`` is the fluid's kinematic one, m^2/s, ``size`` the diameter of the sphere of the
    body's volume, m, ``gravity`` in m/s^2.

    Raises:
      InvalidInput: a number is none, is not positive, or the body neither falls nor rises.
    """

    density_ratio: float
    viscosity: float
    size: float
    gravity: float = 9.81

    def __post_init__(self):
        for field in dataclasses.fields(self):
            value = finite_number(field.name.replace("_", " "), getattr(self, field.name))
            if not LEAST <= value <= MOST:
                raise InvalidInput(
                    f"{field.name.replace('_', ' ')} {value:g}: from {LEAST:g} to {MOST:g}"
                )
            object.__setattr__(self, field.name, value)
        if abs(self.density_ratio - 1) < LEAST:
            raise InvalidInput("density ratio 1: such a body neither falls nor rises")

    @property
    def archimedes(self) -> float:
        """|density ratio - 1| g D^3 / nu^2."""
        weight = abs(self.density_ratio - 1) * self.gravity
        return weight * self.size**3 / self.viscosity**2

    def velocity(self, reynolds: float) -> float:
        """In m/s."""
        return reynolds * self.viscosity / self.size


class Settled(NamedTuple):
    """A particle at its terminal velocity, in m/s, and its Re; ``flows`` were solved to find it.

    ``solution`` is its flow; below Re 0.001 that at 0.001, where Cd Re is the same.
    """

    velocity: float
    reynolds: float
    solution: Solution
    flows: int


def settle(flow: Flow, shape: Shape, particle: Particle, estimate: bool = True) -> Settled:
    """The steady fall or rise of a body along its axis: Cd Re^2 = 4/3 Archimedes number.

    Left to itself a body turns its shortest side to its fall, by inertia (Khayat and Cox 1989).
    By secants in logarithms from the sphere's correlation (Schiller and Naumann 1933). Slower
    particles than any flow is tested for are in Stokes flow: Cd Re is taken as constant.

    Raises:
      InvalidInput: the body is of the plane, or moves too fast for a steady flow.
      NotConverged: a flow was not found, or no balance.
    """
    expect("settling", flow, Flow, "Flow")
    expect("settling", shape, Shape, "Shape; family_shape(..., dimension=3) makes one")
    expect("settling", particle, Particle, "Particle(density_ratio, viscosity, size)")
    if shape.dimension != 3:
        raise InvalidInput("settling: is of bodies in space, dimension 3")
    goal = math.log(4 / 3 * particle.archimedes)
    re, flows = _sphere_reynolds(goal), 0
    slope = (_sphere_thrust(1.01 * re) - _sphere_thrust(re)) / math.log(1.01)
    before, fastest = None, float(onset_of_shedding(shape.extent))
    for _ in range(STEPS):
        re = min(re, fastest)
        at = max(re, RANGE[0])
        found = flow.solve(shape, at, estimate=False)
        miss, flows = math.log(found.drag * at * re) - goal, flows + 1
        if re == fastest and miss < 0:
            raise InvalidInput(
                f"settling: beyond Re {fastest:.3g}, up to which such a body's wake is steady; "
                "a smaller size would do"
            )
        if abs(miss) <= BALANCED:
            if estimate:
                found = flow.solve(shape, at)
            return Settled(particle.velocity(re), re, found, flows)
        if before is not None:
            slope = (miss - before[1]) / math.log(re / before[0])
        before = re, miss
        re *= math.exp(-miss / slope)
    raise NotConverged(f"settling: drag and weight differ by {abs(miss):.1e} after {flows} flows")


def _sphere_thrust(reynolds):
    """log Cd Re^2 of a sphere."""
    return math.log(24 * reynolds * (1 + 0.15 * reynolds**0.687))


def _sphere_reynolds(thrust):
    """The sphere's Re at a thrust, by bisection."""
    low, high = -20.0, 20.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _sphere_thrust(math.exp(middle)) < thrust else (low, middle)
    return math.exp(low)
