"""An objective under uncertainty: the mean of Cd or of Cl / Cd, or of its worst cases."""

import dataclasses
from typing import Any

import numpy as np
import scipy  # its submodules load at first use; scipy.stats takes half a second

from shapeopt.problem.objective import Objective, scenarios_of
from shapeopt.problem.scenarios import Scenarios
from shapeopt.problem.uncertainty import LogNormal, Uniform, latin_hypercube
from surrogate.checks import expect, finite_number, flag, real_numbers, whole_number
from surrogate.errors import InvalidInput
from surrogate.scene.samples import LARGEST_SEED
from surrogate.scene.scene import Scene

# The normal changes of shape are truncated here, in standard deviations, so that they are bounded
# and no scenario leaves the trained ranges.
TRUNCATION = 2.0
LEAST_KEPT = 0.5 - 1e-6  # probability of the spread that must lie within the trained range of Re


@dataclasses.dataclass(frozen=True)
class Robust(Objective):
    """The mean of Cd, or of its worst cases, under an uncertain Re and an inexact shape.

    With ``glide`` it is the mean glide ratio Cl / Cd, or that of the cases where it is least, which
    is maximised. Bodies keep the largest change of shape in the sample, at most 2 tolerances, away
    from the ends of the trained ranges, so that no case leaves them.

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
      glide: whether the loss of a case is -Cl / Cd, in place of Cd.
    """

    reynolds: float
    spread: LogNormal | Uniform | float
    tolerance: float = 0.0
    level: float = 0.0
    cases: int = 32
    seed: int = 0
    glide: bool = False

    def __post_init__(self):
        if real_numbers(self.spread) is not None:  # LogNormal refuses what is no spread
            object.__setattr__(self, "spread", LogNormal(self.spread))
        expect("spread", self.spread, LogNormal | Uniform, "distribution, as LogNormal(0.2)")
        object.__setattr__(self, "glide", flag("glide", self.glide))
        texts = {"reynolds": "Reynolds number", "level": "CVaR level", "tolerance": "tolerance"}
        for name, text in texts.items():
            object.__setattr__(self, name, finite_number(text, getattr(self, name)))
        if not 0 <= self.level < 1:
            raise InvalidInput(f"CVaR level {self.level:g}: from 0 (the mean) to below 1")
        if not 0 <= self.tolerance <= 0.1:
            raise InvalidInput(f"tolerance {self.tolerance:g}: from 0 to 0.1 of a range's width")
        for name, low, high in (("cases", 2, 4096), ("seed", 0, LARGEST_SEED)):
            object.__setattr__(self, name, whole_number(name, getattr(self, name), low, high))

    @property
    def nominal(self) -> float:
        """The Reynolds number about which Re is distributed."""
        return self.reynolds

    def kept(self, scene: Scene) -> float:
        """Return the probability of the spread that lies within the scene's range of Re."""
        return float(np.ptp(self._probabilities(scene)))

    def scenarios(self, scene: Scene) -> Scenarios:
        """Return the points of a Latin hypercube sample of Re and shape, equally weighted.

        Raises:
          InvalidInput: Re is outside the scene's range, more than half of the spread is, or the
            glide ratio is asked for where bodies have no lift.
        """
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
        normal = scipy.stats.truncnorm(-TRUNCATION, TRUNCATION).ppf(quantiles[:, 1:])
        weight = np.full(self.cases, 1 / self.cases)
        shift = self.tolerance * width * normal
        return scenarios_of(scene, reynolds, weight, shift, level=self.level, glide=self.glide)

    def record(self, scene: Scene) -> dict[str, Any]:
        """Return the settings of the distribution, and the share of it within the scene's range."""
        return {
            "spread": self.spread.spread,
            "distribution": type(self.spread).__name__,
            "tolerance": self.tolerance,
            "cvar": self.level,
            "glide": self.glide,
            "seed": self.seed,
            "kept": self.kept(scene),
        }

    def _probabilities(self, scene):
        """Return the probabilities of an Re below the two ends of the scene's range."""
        if not self.spread.spread:
            return 0.0, 1.0
        return tuple(self.spread.around(self.reynolds).cdf(scene.reynolds).tolist())
