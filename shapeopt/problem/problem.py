"""What is asked for: an objective to be least, under constraints on the body."""

import dataclasses
import functools
import math

import numpy as np
from jaxtyping import Float

from shapeopt.problem.constraints import Limits, Station
from shapeopt.problem.feasible import explain_conflict, feasible_bodies
from shapeopt.problem.objective import AtReynolds, Objective, Scenarios
from surrogate.arrays import AnyArray
from surrogate.body.family import PARAMETERS, Family
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene


@dataclasses.dataclass(frozen=True)
class Problem:
    """Minimise an objective over the scene's family; the area is pi/4 by construction.

    ``reynolds`` is a number (least Cd there) or an objective. ``max_length`` bounds the chord,
    ``min_thickness`` the greatest thickness, ``stations`` the thickness at places along the
    chord, ``min_radius`` the radius of curvature all around, all in D. ``within`` narrows the
    family's ranges. ``trust`` keeps every shape parameter away from both edges of its trained
    range by this share of the range's width, since a surrogate is least sure at the edges.
    """

    scene: Scene
    reynolds: float | Objective
    max_length: float | None = None
    min_thickness: float | None = None
    stations: tuple[Station, ...] = ()
    min_radius: float | None = None
    within: Family | None = None
    trust: float = 0.0

    def __post_init__(self):
        lengths = {name: getattr(self, name) for name in ("max_length", "min_thickness")}
        lengths["min_radius"] = self.min_radius
        lengths |= {f"thickness at {s.x:g} c": s.thickness for s in self.stations}
        for name, bound in lengths.items():
            if bound is not None and not (math.isfinite(bound) and bound > 0):
                raise InvalidInput(f"{name} {bound:g}: must be a finite length above 0, in D")
        for station in self.stations:
            if not 0 < station.x < 1:
                raise InvalidInput(f"station x/c = {station.x:g}: between 0 (nose) and 1 (tail)")
        if not 0 <= self.trust < 0.5:
            raise InvalidInput(f"trust {self.trust:g}: from 0 to below 0.5 of a range's width")
        self._check_ranges()

    @property
    def objective(self) -> Objective:
        """What is to be least."""
        plain = isinstance(self.reynolds, int | float)
        return AtReynolds(float(self.reynolds)) if plain else self.reynolds

    @functools.cached_property
    def scenarios(self) -> Scenarios:
        """The objective's cases."""
        return self.objective.scenarios(self.scene)

    @functools.cached_property
    def limits(self) -> Limits:
        """All constraints as numbers."""
        low, high = self._ranges()
        longest = 100.0 if self.max_length is None else self.max_length
        return Limits(
            low,
            high,
            self.scenarios.shift,
            np.asarray(float(longest)),
            np.asarray(self.min_thickness or 0.0),
            np.array(self.stations, float).reshape(-1, 2),
            np.asarray(self.min_radius or 0.0),
        )

    def candidates(self) -> Float[AnyArray, "bodies parameters"]:
        """Feasible bodies from all over the family.

        Raises:
          InvalidInput: there is none; the message names the constraints in conflict.
        """
        bodies = feasible_bodies(self.limits)
        if not len(bodies):
            raise InvalidInput(explain_conflict(self))
        return bodies

    def _ranges(self):
        """Ranges of the parameters after ``within``, ``trust`` and the objective's tolerance."""
        low, high = self.scene.family.bounds.T
        inset = np.maximum(self.trust * (high - low), np.abs(self.scenarios.shift).max(axis=0))
        low, high = low + inset, high - inset
        if self.within is not None:
            low = np.maximum(low, self.within.bounds[:, 0])
            high = np.minimum(high, self.within.bounds[:, 1])
        return low, high

    def _check_ranges(self):
        if self.within is not None:
            trained = self.scene.family.bounds
            for name, (a, b), (low, high) in zip(
                PARAMETERS, self.within.bounds, trained, strict=True
            ):
                if not low - 1e-9 <= a <= b <= high + 1e-9:
                    raise InvalidInput(
                        f"range of {name} {a:g} to {b:g}: must lie within the family's, "
                        f"{low:g} to {high:g}"
                    )
        for name, low, high in zip(PARAMETERS, *self._ranges(), strict=True):
            if low > high:
                raise InvalidInput(
                    f"{name}: its range and trust {self.trust:g} (or the tolerance) contradict "
                    "each other; relax one of them"
                )
