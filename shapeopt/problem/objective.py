"""Objectives: drag at one Reynolds number, over several, uncertain or tumbling; glide; settling.

An objective states its scenarios; ``shapeopt.problem.scenarios`` makes one number of their loads.
A new objective is a subclass of ``Objective`` here, and nothing else.
"""

import abc
import dataclasses
import math
from typing import Any, ClassVar

import jax
import numpy as np
from jaxtyping import Float
from scipy import stats

from shapeopt.problem.scenarios import Scenarios
from shapeopt.problem.uncertainty import LogNormal, Uniform, latin_hypercube
from surrogate.arrays import AnyArray
from surrogate.body.parameters import INCIDENCE, QUARTER_TURN
from surrogate.checks import expect, finite_number, real_numbers, whole_number
from surrogate.errors import InvalidInput
from surrogate.flow.settling import BALANCED, SMALLEST, sphere_reynolds
from surrogate.scene.scene import Scene

# The normal changes of shape are truncated here, in standard deviations, so that they are bounded
# and no scenario leaves the trained ranges.
TRUNCATION = 2.0
ORIENTATIONS = 6  # points of Gauss's rule over the cosine of the incidence
MOST_ARCHIMEDES = 1e6  # a sphere settles at Re 2000, beyond any steady flow
LEAST_KEPT = 0.5 - 1e-6  # probability of the spread that must lie within the trained range of Re


class Objective(abc.ABC):
    """What is minimised: one number made of the loads over scenarios.

    ``fixed`` says whether the scenarios are known before the search; otherwise each optimum has a
    ``following`` objective, until there is none (``shapeopt.search.following``).
    """

    fixed: ClassVar[bool] = True

    @property
    @abc.abstractmethod
    def nominal(self) -> float:
        """The Reynolds number at which a design's Cd is reported."""

    @abc.abstractmethod
    def scenarios(self, scene: Scene) -> Scenarios:
        """Return the cases of the objective in a scene.

        Raises:
          InvalidInput: a Reynolds number is outside the scene's range.
        """

    def following(
        self,
        scene: Scene,
        loads: Float[AnyArray, " loads"],
        by_log_reynolds: Float[AnyArray, " loads"],
    ) -> "Objective | None":
        """Return the objective to be minimised next, or None where its optimum is the answer.

        Args:
          scene: of the problem.
          loads: of the optimum, in the first scenario.
          by_log_reynolds: their derivatives in log Re.

        Raises:
          InvalidInput: there is no answer within the scene.
        """
        return None

    def record(self, scene: Scene) -> dict[str, Any]:
        """Return the settings that are stored with a run."""
        return {}


@dataclasses.dataclass(frozen=True)
class AtReynolds(Objective):
    """Cd at one Reynolds number."""

    reynolds: float

    @property
    def nominal(self) -> float:
        return self.reynolds

    def scenarios(self, scene: Scene) -> Scenarios:
        return _scenarios(scene, [scene.check_reynolds(self.reynolds)], [1.0])


@dataclasses.dataclass(frozen=True)
class Glide(AtReynolds):
    """The glide ratio Cl / Cd at one Reynolds number, which is maximised: -Cl / Cd is minimised."""

    def scenarios(self, scene: Scene) -> Scenarios:
        if scene.family.body_class.symmetric:
            raise InvalidInput("glide: the bodies of this scene have no lift; camber or incidence")
        return _scenarios(scene, [scene.check_reynolds(self.reynolds)], [1.0], glide=True)


@dataclasses.dataclass(frozen=True)
class Tumbling(AtReynolds):
    """Cd averaged over all orientations of a body that tumbles, at one Reynolds number.

    For scenes of 3-D bodies at incidences from 0 to 90 degrees. The axis points everywhere with
    equal probability, so that the incidence has the density sin(incidence). Bodies that are not
    alike fore and aft are averaged over the half of the orientations with the nose ahead. The
    incidence of the design itself is 45 degrees, about which those of the cases are spread.
    """

    def scenarios(self, scene: Scene) -> Scenarios:
        names, middle = scene.family.names, QUARTER_TURN / 2
        turned = dict(scene.family.ranges).get(INCIDENCE.name) == (0, QUARTER_TURN)
        if scene.dimension != 3 or not turned:
            raise InvalidInput(
                "tumbling: needs a scene of 3-D bodies with the incidences 0 to 90, as that of "
                "pretrained:particle"
            )
        cosines, weight = np.polynomial.legendre.leggauss(ORIENTATIONS)
        angles = np.rad2deg(np.arccos((1 + cosines) / 2))
        angles = np.append(angles, [0, QUARTER_TURN])  # without weight: they keep the design at 45
        shift = np.zeros((len(angles), len(names)))
        shift[:, names.index(INCIDENCE.name)] = angles - middle
        reynolds = [scene.check_reynolds(self.reynolds)] * len(angles)
        return _scenarios(scene, reynolds, np.append(weight / 2, [0, 0]), shift)


@dataclasses.dataclass(frozen=True)
class Settling(Objective):
    """The terminal velocity of a particle, which is maximised, for scenes of 3-D bodies.

    A body moves steadily where the force on it balances its weight less buoyancy,
    C Re^2 = 4/3 Ar with C = sqrt(Cd^2 + Cl^2). Its velocity is Re nu / D, and its incidence is that
    to its motion. The least C Re^2 of all bodies grows with Re, so the fastest body has the least C
    at its own Re: C is minimised at one Re after another, by Newton's method in log Re.

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
        return self.reynolds

    def scenarios(self, scene: Scene) -> Scenarios:
        if scene.dimension != 3:
            raise InvalidInput("settling: needs a scene of 3-D bodies, dimension 3")
        return _scenarios(scene, [self._within(scene)], [1.0], force=True)

    def following(self, scene, loads, by_log_reynolds):
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
        return {"archimedes": self.archimedes}

    def _within(self, scene):
        """Return the Re of the search, within the scene's range."""
        return float(np.clip(self.reynolds, *scene.reynolds))


@dataclasses.dataclass(frozen=True)
class Weighted(Objective):
    """The weighted mean, over Reynolds numbers, of Cd over the cylinder's (sphere's) Cd.

    It is relative because Cd falls with Re: the lowest Re would dominate a mean of Cd.

    Args:
      reynolds: Reynolds numbers within the scene's range.
      weights: positive weights, one for each; only their ratios matter.
    """

    reynolds: tuple[float, ...]
    weights: tuple[float, ...]

    def __post_init__(self):
        for name in ("reynolds", "weights"):
            values = getattr(self, name)
            expect(name, values, list | tuple | np.ndarray | jax.Array, "list of numbers")
            if np.ndim(values) != 1:
                raise InvalidInput(f"{name} {values!r}: a list of numbers is needed")
            object.__setattr__(self, name, tuple(finite_number(name, one) for one in values))
        if len(self.reynolds) != len(self.weights) or not self.reynolds:
            raise InvalidInput(
                f"weights: {len(self.weights)} for {len(self.reynolds)} Reynolds numbers; "
                "give one for each"
            )
        if not all(weight > 0 for weight in self.weights):
            raise InvalidInput("weights: every one must be a finite number above 0")

    @property
    def nominal(self) -> float:
        """The Reynolds number of the largest weight."""
        return self.reynolds[int(np.argmax(self.weights))]

    def scenarios(self, scene: Scene) -> Scenarios:
        reynolds = [scene.check_reynolds(value) for value in self.reynolds]
        weight = np.array(self.weights) / max(self.weights)
        return _scenarios(scene, reynolds, weight / weight.sum(), relative=True)


@dataclasses.dataclass(frozen=True)
class Robust(Objective):
    """The mean of Cd, or of its worst cases, under an uncertain Re and an inexact shape.

    Bodies keep 2 tolerances away from the edges of the trained ranges, so that no case leaves them.

    Args:
      reynolds: nominal Reynolds number.
      spread: distribution of Re about it, ``LogNormal`` or ``Uniform``; truncated at the ends of
        the scene's range and renormalised. A number is that of ``LogNormal``.
      tolerance: standard deviation of the normal distribution from which changes of every shape
        parameter are drawn, before it is truncated at +-2 standard deviations; in widths of the
        parameter's range, 0 to 0.1. After truncation the standard deviation is 0.88 of it.
      level: CVaR level, 0 to below 1: 0 is the mean of all cases, 0.9 the mean of the worst tenth
        (conditional value at risk).
      cases: number of cases, 2 to 4096.
      seed: of the Latin hypercube sample; all bodies see the same cases.
    """

    reynolds: float
    spread: LogNormal | Uniform | float
    tolerance: float = 0.0
    level: float = 0.0
    cases: int = 32
    seed: int = 0

    def __post_init__(self):
        if real_numbers(self.spread) is not None:  # LogNormal refuses what is no spread
            object.__setattr__(self, "spread", LogNormal(self.spread))
        expect("spread", self.spread, LogNormal | Uniform, "distribution, as LogNormal(0.2)")
        texts = {"reynolds": "Reynolds number", "level": "CVaR level", "tolerance": "tolerance"}
        for name, text in texts.items():
            object.__setattr__(self, name, finite_number(text, getattr(self, name)))
        if not 0 <= self.level < 1:
            raise InvalidInput(f"CVaR level {self.level:g}: from 0 (the mean) to below 1")
        if not 0 <= self.tolerance <= 0.1:
            raise InvalidInput(f"tolerance {self.tolerance:g}: from 0 to 0.1 of a range's width")
        for name, low, high in (("cases", 2, 4096), ("seed", 0, 2**31 - 1)):
            object.__setattr__(self, name, whole_number(name, getattr(self, name), low, high))

    @property
    def nominal(self) -> float:
        return self.reynolds

    def kept(self, scene: Scene) -> float:
        """Return the probability of the spread that lies within the scene's range of Re."""
        return float(np.ptp(self._probabilities(scene)))

    def scenarios(self, scene: Scene) -> Scenarios:
        nominal, kept = scene.check_reynolds(self.reynolds), self.kept(scene)
        if kept < LEAST_KEPT:
            raise InvalidInput(
                f"spread {self.spread.spread:g} about Re {nominal:g}: only "
                f"{100 * kept:.0f} % of it lies within the trained range; at least half must"
            )
        width = np.ptp(scene.family.bounds, axis=1)
        quantiles = latin_hypercube(self.seed, self.cases, 1 + len(width))
        reynolds = np.full(self.cases, nominal)
        if self.spread.spread:
            probability = self._probabilities(scene)[0] + kept * quantiles[:, 0]
            reynolds = self.spread.around(nominal).ppf(probability)
        reynolds = np.clip(reynolds, *scene.reynolds)  # against rounding alone
        normal = stats.truncnorm(-TRUNCATION, TRUNCATION).ppf(quantiles[:, 1:])
        weight = np.full(self.cases, 1 / self.cases)
        shift = self.tolerance * width * normal
        return _scenarios(scene, reynolds, weight, shift, level=self.level)

    def record(self, scene: Scene) -> dict[str, Any]:
        return {
            "spread": self.spread.spread,
            "distribution": type(self.spread).__name__,
            "tolerance": self.tolerance,
            "cvar": self.level,
            "seed": self.seed,
            "kept": self.kept(scene),
        }

    def _probabilities(self, scene):
        """Return the probabilities of an Re below the two ends of the scene's range."""
        if not self.spread.spread:
            return 0.0, 1.0
        return tuple(self.spread.around(self.reynolds).cdf(scene.reynolds).tolist())


def _scenarios(
    scene: Scene,
    reynolds: list[float] | Float[AnyArray, " cases"],
    weight: list[float] | Float[AnyArray, " cases"],
    shift: Float[AnyArray, "cases parameters"] | None = None,
    relative: bool = False,
    level: float = 0.0,
    glide: bool = False,
    force: bool = False,
) -> Scenarios:
    if shift is None:
        shift = np.zeros((len(reynolds), len(scene.family.names)))
    return Scenarios(
        *(np.asarray(value, float) for value in (shift, reynolds, weight)),
        np.asarray(relative),
        np.asarray(glide),
        np.asarray(force),
        np.asarray(level),
        scene.family.ellipse(1.0),
        np.zeros(0),
    )
