"""Objectives of particles: drag averaged over all orientations, and the terminal velocity."""

import dataclasses
import math
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from shapeopt.problem.objective import AtReynolds, Objective, scenarios_of
from shapeopt.problem.scenarios import Scenarios
from surrogate.arrays import AnyArray
from surrogate.body.parameters import INCIDENCE, QUARTER_TURN
from surrogate.checks import SMALLEST, finite_number
from surrogate.errors import InvalidInput
from surrogate.flow.settling import BALANCED, sphere_reynolds
from surrogate.scene.scene import Scene

FLATNESS = "flatness"
ORIENTATIONS = 6  # points of Gauss's rule over the cosine of the incidence
MOST_ARCHIMEDES = 1e6  # a sphere settles at Re 2000, beyond any steady flow


@dataclasses.dataclass(frozen=True)
class Tumbling(AtReynolds):
    """Cd averaged over all orientations of a body of revolution that tumbles, at one Re.

    For scenes of 3-D bodies at incidences from 0 to 90 degrees. The axis points everywhere with
    equal probability, so that the incidence has the density sin(incidence). Flattened bodies would
    be rolled about their axis too, where they have no plane of symmetry: the flatness is held at 1.
    Bodies that are not alike fore and aft are averaged over the half of the orientations with the
    nose ahead. The incidence of the design itself is 45 degrees, about which those of the cases are
    spread.
    """

    def scenarios(self, scene: Scene) -> Scenarios:
        """Return one scenario for each incidence of Gauss's rule.

        Raises:
          InvalidInput: the scene is not of 3-D bodies at incidences from 0 to 90 degrees.
        """
        names, middle = scene.family.names, QUARTER_TURN / 2
        ranges = dict(scene.family.ranges)
        turned = ranges.get(INCIDENCE.name) == (0, QUARTER_TURN)
        if scene.dimension != 3 or not turned:
            raise InvalidInput(
                "tumbling: needs a scene of 3-D bodies with the incidences 0 to 90, as that of "
                "pretrained:particle"
            )
        low, high = ranges.get(FLATNESS, (1.0, 1.0))
        if not low <= 1 <= high:
            raise InvalidInput("tumbling: needs bodies of revolution, flatness 1")
        cosines, weight = np.polynomial.legendre.leggauss(ORIENTATIONS)
        angles = np.rad2deg(np.arccos((1 + cosines) / 2))
        shift = np.zeros((len(angles), len(names)))
        shift[:, names.index(INCIDENCE.name)] = angles - middle
        return scenarios_of(scene, [self.reynolds] * len(angles), weight / 2, shift)

    def fixed_parameters(self, scene: Scene) -> dict[str, float]:
        """Return the incidence 45, and the flatness 1 where the scene's bodies may be flattened."""
        held = {INCIDENCE.name: QUARTER_TURN / 2, FLATNESS: 1.0}
        return {name: value for name, value in held.items() if name in scene.family.names}


@dataclasses.dataclass(frozen=True)
class Settling(Objective):
    """The speed of a particle that settles steadily, which is maximised, for scenes of 3-D bodies.

    A body moves steadily where the force on it balances its weight less buoyancy,
    C Re^2 = 4/3 Ar with C = sqrt(Cd^2 + Cl^2). The speed along its path is Re nu / D, and the
    incidence is that to its motion; with lift the path is inclined. The least C Re^2 of all bodies
    grows with Re, so the fastest body has the least C at its own Re: C is minimised at one Re after
    another, by Newton's method in log Re.

    Args:
      archimedes: Ar = |density ratio - 1| g D^3 / nu^2, as ``Particle.archimedes``.
      reynolds: where the search begins; by default that of the sphere, by Schiller and Naumann.
    """

    archimedes: float
    reynolds: float | None = None

    fixed: ClassVar[bool] = False

    def __post_init__(self):
        archimedes = finite_number("Archimedes number", self.archimedes)
        if not SMALLEST <= archimedes <= MOST_ARCHIMEDES:
            raise InvalidInput(
                f"Archimedes number {archimedes:g}: from {SMALLEST:g} to {MOST_ARCHIMEDES:g}"
            )
        object.__setattr__(self, "archimedes", archimedes)
        begin = sphere_reynolds(archimedes) if self.reynolds is None else self.reynolds
        object.__setattr__(self, "reynolds", finite_number("Reynolds number", begin))

    @property
    def nominal(self) -> float:
        """The Reynolds number at which the search is now."""
        return self.reynolds

    def scenarios(self, scene: Scene) -> Scenarios:
        """Return the one scenario, with the magnitude of the force as the loss.

        Raises:
          InvalidInput: the scene is not of 3-D bodies.
        """
        if scene.dimension != 3:
            raise InvalidInput("settling: needs a scene of 3-D bodies, dimension 3")
        return scenarios_of(scene, [self._within(scene)], [1.0], force=True)

    def following(
        self,
        scene: Scene,
        loads: Float[AnyArray, " loads"],
        by_log_reynolds: Float[AnyArray, " loads"],
    ) -> "Settling | None":
        """Return the objective after a Newton step in log Re, or None where force balances weight.

        Args:
          scene: of the problem.
          loads: Cd and, where there is one, Cl of the optimum.
          by_log_reynolds: their derivatives in log Re.

        Raises:
          InvalidInput: they balance outside the scene's range of Re.
        """
        at, force = self._within(scene), np.asarray(loads)[:2]  # Cd and, where there is one, Cl
        thrust = np.linalg.norm(force) * at**2
        excess = math.log(thrust / (4 / 3 * self.archimedes))
        if abs(excess) <= BALANCED and at == self.reynolds:
            return None
        slope = 2 + force @ np.asarray(by_log_reynolds)[:2] / (force @ force)
        reynolds = float(np.clip(at * math.exp(-excess / slope), *scene.reynolds))
        if reynolds == at and abs(excess) > BALANCED:
            side, most = ("above", "at most") if excess < 0 else ("below", "at least")
            raise InvalidInput(
                f"Archimedes number {self.archimedes:g}: the fastest body settles {side} Re "
                f"{at:g}, where the scene ends; {most} {0.75 * thrust:.4g} would do"
            )
        return dataclasses.replace(self, reynolds=reynolds)

    def record(self, scene: Scene) -> dict[str, Any]:
        """Return the Archimedes number."""
        return {"archimedes": self.archimedes}

    def _within(self, scene):
        """Return the Re of the search, within the scene's range."""
        return float(np.clip(self.reynolds, *scene.reynolds))
