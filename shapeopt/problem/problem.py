"""The problem: minimise an objective over the scene's family under constraints."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from shapeopt.problem.constraints import Limits, Station
from shapeopt.problem.objective import AtReynolds, Objective, Scenarios
from surrogate.arrays import Number
from surrogate.checks import expect, finite_number, interval
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene

UNBOUNDED_LENGTH = 100.0  # D: longer than any body of a family


@dataclasses.dataclass(frozen=True)
class Problem:
    """Minimise an objective over the scene's family; the area pi/4, or the volume pi/6, is given.

    ``reynolds`` is a number (least Cd there) or an objective. ``max_length`` bounds the chord,
    ``min_thickness`` and ``max_thickness`` the greatest thickness (in space the height),
    ``stations`` the thickness at places along the chord, ``min_radius`` the radius of curvature
    all around (in space of the outline seen from the side), all in D. ``within`` narrows ranges
    of the family, by name. ``trust`` keeps every shape parameter away from both edges of its
    trained range by this share of the range's width, since a surrogate is least sure at the edges.

    Raises:
      InvalidInput: a number makes no sense, or the ranges contradict each other.
    """

    scene: Scene
    reynolds: Number | Objective
    max_length: Number | None = None
    min_thickness: Number | None = None
    stations: tuple[Station, ...] = ()
    min_radius: Number | None = None
    within: Mapping[str, Any] | None = None
    trust: Number = 0.0
    max_thickness: Number | None = None

    def __post_init__(self):
        if not isinstance(self.scene, Scene):
            raise InvalidInput(f"problem: {self.scene!r} is no Scene")
        if isinstance(self.reynolds, list | tuple):
            raise InvalidInput(
                f"Reynolds numbers {self.reynolds}: one number, or Weighted(reynolds, weights)"
            )
        if not isinstance(self.reynolds, Objective):
            object.__setattr__(self, "reynolds", self.scene.check_reynolds(self.reynolds))
        expect("stations", self.stations, list | tuple, "list of Station(x, thickness)")
        object.__setattr__(self, "stations", tuple(map(_station, self.stations)))
        expect("within", self.within, Mapping | None, "table of ranges, as {'aspect': (1, 3)}")
        for name in ("max_length", "min_thickness", "max_thickness", "min_radius"):
            if (bound := getattr(self, name)) is not None:
                object.__setattr__(self, name, _length(name, bound))
        object.__setattr__(self, "trust", finite_number("trust", self.trust))
        if not 0 <= self.trust < 0.5:
            raise InvalidInput(f"trust {self.trust:g}: from 0 to below 0.5 of a range's width")
        self._check_ranges()

    @property
    def objective(self) -> Objective:
        """What is to be least."""
        given = self.reynolds
        return given if isinstance(given, Objective) else AtReynolds(given)

    @functools.cached_property
    def scenarios(self) -> Scenarios:
        """The objective's cases."""
        return self.objective.scenarios(self.scene)

    @functools.cached_property
    def limits(self) -> Limits:
        """All constraints as numbers."""
        low, high = self._ranges()
        longest = UNBOUNDED_LENGTH if self.max_length is None else self.max_length
        bounds = [] if self.max_thickness is None else [self.max_thickness]
        return Limits(
            low,
            high,
            self.scenarios.shift,
            np.asarray(longest),
            np.asarray(self.min_thickness or 0.0),
            np.asarray(bounds, float),
            np.array(self.stations, float).reshape(-1, 2),
            np.asarray(self.min_radius or 0.0),
            self.scene.family.body_class,
        )

    def _ranges(self):
        """Ranges of the parameters after ``within``, ``trust`` and the objective's tolerance."""
        family = self.scene.family
        low, high = family.bounds.T
        inset = np.maximum(self.trust * (high - low), np.abs(self.scenarios.shift).max(axis=0))
        low, high = low + inset, high - inset
        for name, (least, most) in (self.within or {}).items():
            k = family.names.index(name)
            low[k], high[k] = max(low[k], least), min(high[k], most)
        return low, high

    def _check_ranges(self):
        trained = dict(self.scene.family.ranges)
        for name, value in (self.within or {}).items():
            if name not in trained:
                raise InvalidInput(f"range of {name}: the family has {', '.join(trained)}")
            (least, most), (low, high) = interval(f"range of {name}", value), trained[name]
            if not low - 1e-9 <= least <= most <= high + 1e-9:
                raise InvalidInput(
                    f"range of {name} {least:g} to {most:g}: must lie within the family's, "
                    f"{low:g} to {high:g}"
                )
        for name, low, high in zip(trained, *self._ranges(), strict=True):
            if low > high:
                raise InvalidInput(
                    f"{name}: its range and trust {self.trust:g} (or the tolerance) contradict "
                    "each other; relax one of them"
                )


def _station(given: Any) -> Station:
    """A station of plain floats."""
    expect("stations", given, Station, "Station(x, thickness)")
    x = finite_number("station x/c", given.x)
    if not 0 < x < 1:
        raise InvalidInput(f"station x/c = {x:g}: between 0 (nose) and 1 (tail)")
    return Station(x, _length(f"thickness at {x:g} c", given.thickness))


def _length(name: str, given: Any) -> float:
    """Above 0, as a float."""
    length = finite_number(name, given)
    if not length > 0:
        raise InvalidInput(f"{name} {length:g}: must be a finite length above 0, in D")
    return length
