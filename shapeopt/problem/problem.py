"""The problem: minimise an objective over the scene's family of bodies under constraints."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from shapeopt.problem.bounds import checked_length, checked_load, checked_station
from shapeopt.problem.constraints import BOUNDS, Limits, Station
from shapeopt.problem.objective import AtReynolds, Objective, Weighted
from shapeopt.problem.reference import Reference, covered_aspects
from shapeopt.problem.scenarios import LOAD_BOUNDS, UNBOUNDED, Scenarios
from surrogate.arrays import AnyArray
from surrogate.checks import did_you_mean, expect, finite_number, flag, interval
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene
from surrogate.scene.stream import Unbounded

LEAST_GAP = 1e-6  # between the bounds on Cm: searches need an interior
NO_CONSTRAINTS = ("scene", "reynolds", "by_chord")  # fields of Problem that are none
RANGE_END = 1e-6  # of a range's width, within which a parameter is at its end


@dataclasses.dataclass(frozen=True)
class Problem:
    """An objective to be minimised over the bodies of a scene's family, under constraints.

    All bodies have the area pi/4 (in 3-D the volume pi/6), so their equivalent diameter D is 1.
    Lengths are in D, coefficients and Reynolds numbers by D, unless the problem is by the chord.

    Args:
      scene: stream, family of bodies and fidelity.
      reynolds: a Reynolds number U D / nu (``by_chord``: U c / nu), to minimise Cd there; or an
        objective, ``Glide``, ``MultiPoint``, ``Settling``, ``Tumbling``, ``Weighted`` or
        ``Robust``; several numbers are ``Weighted`` equally.
      max_length: upper bound on the chord.
      min_thickness: lower bound on the greatest thickness; in 3-D on the height.
      stations: lower bounds on the thickness at places along the chord, ``Station(x, thickness)``.
      min_radius: lower bound on the radius of curvature all around the outline; in 3-D of the
        outline seen from the side.
      within: narrower ranges of parameters by name, as ``{"aspect": (1, 3)}``; that of a
        parameter that the objective holds, as ``Tumbling`` does, has to be its value alone.
      trust: distance that every shape parameter keeps from both ends of its trained range, as a
        share of the range's width, from 0 to below 0.5; a surrogate is least accurate at the ends.
        A parameter that the objective holds is exempt.
      max_thickness: upper bound on the greatest thickness; in 3-D on the height.
      lift: lower bound on Cl, in every case of the objective; for scenes whose bodies have lift.
      min_moment: lower bound on Cm, about the centroid, nose up.
      max_moment: upper bound on Cm; if it is the lower bound too, Cm is held within 5e-7 of it.
      max_camber: upper bound on the distance of the camber line from the chord, for scenes whose
        bodies have camber.
      by_chord: whether to optimise at fixed chord c, with the area free, in place of fixed area:
        Reynolds numbers are U c / nu, loads and their bounds Cd / c, Cl / c and Cm / c^2 with c in
        D, and lengths are in chords, so that ``min_thickness`` is t/c. For 2-D bodies in unbounded
        streams at a single Reynolds number (also of ``Glide``), without ``max_length``.

    Raises:
      InvalidInput: a value is out of its range, or the ranges of parameters contradict each other.
    """

    scene: Scene
    reynolds: float | Sequence[float] | Float[AnyArray, " cases"] | Objective
    max_length: float | None = None
    min_thickness: float | None = None
    stations: Sequence[Station | tuple[float, float]] = ()
    min_radius: float | None = None
    within: Mapping[str, tuple[float, float]] | None = None
    trust: float = 0.0
    max_thickness: float | None = None
    lift: float | None = None
    min_moment: float | None = None
    max_moment: float | None = None
    max_camber: float | None = None
    by_chord: bool = False

    def __post_init__(self):
        expect("problem", self.scene, Scene, "Scene")
        if isinstance(self.reynolds, list | tuple) or getattr(self.reynolds, "ndim", 0) == 1:
            several = tuple(self.reynolds)
            equal = several[0] if len(several) == 1 else Weighted(several, (1.0,) * len(several))
            object.__setattr__(self, "reynolds", equal)
        if not isinstance(self.reynolds, Objective):
            object.__setattr__(self, "reynolds", AtReynolds(self.reynolds).reynolds)
        expect("stations", self.stations, list | tuple, "list of Station(x, thickness)")
        object.__setattr__(self, "by_chord", flag("by_chord", self.by_chord))
        stations = (checked_station(given, self.reference.symbol) for given in self.stations)
        object.__setattr__(self, "stations", tuple(stations))
        expect("within", self.within, Mapping | None, "table of ranges, as {'aspect': (1, 3)}")
        if self.within is not None:
            ranges = {name: interval(f"range of {name}", x) for name, x in self.within.items()}
            object.__setattr__(self, "within", ranges)
        for name in BOUNDS:
            if (bound := getattr(self, name)) is not None:
                object.__setattr__(self, name, checked_length(name, bound, self.reference.symbol))
        if self.max_camber is not None and not self.scene.family.body_class.camber_modes:
            raise InvalidInput("max camber: the bodies of this scene have no camber")
        for name in LOAD_BOUNDS:
            if (bound := getattr(self, name)) is not None:
                object.__setattr__(self, name, checked_load(self.scene, name, bound))
        if self.lift is not None and self.objective.lifts:
            raise InvalidInput("lift: the objective has a bound on the lift in each of its cases")
        low, high = self.min_moment, self.max_moment
        if low is not None and high is not None and low > high:
            raise InvalidInput(f"min moment {low:g} is above max moment {high:g}")
        object.__setattr__(self, "trust", finite_number("trust", self.trust))
        if not 0 <= self.trust < 0.5:
            raise InvalidInput(f"trust {self.trust:g}: from 0 to below 0.5 of a range's width")
        if self.by_chord:
            self._check_by_chord()
        self._check_ranges()

    def __str__(self) -> str:
        bounds = [f"{name} {value}" for name, value in self.constraints.items()]
        bounds += ["by the chord"] * self.by_chord
        return ", ".join([str(self.objective), *bounds, f"in {self.scene}"])

    @property
    def objective(self) -> Objective:
        """The objective that is minimised: ``reynolds``, or Cd there where it is a number."""
        given = self.reynolds
        return given if isinstance(given, Objective) else AtReynolds(given)

    @property
    def constraints(self) -> dict[str, object]:
        """The constraints that are set, by their names as arguments of ``Problem``."""
        fields = (one for one in dataclasses.fields(self) if one.name not in NO_CONSTRAINTS)
        values = ((field, getattr(self, field.name)) for field in fields)
        return {field.name: value for field, value in values if value != field.default}

    @property
    def reference(self) -> Reference:
        """Reference length of Reynolds numbers, coefficients and bounds."""
        return Reference(self.scene.family.body_class, self.by_chord)

    @functools.cached_property
    def scenarios(self) -> Scenarios:
        """The scenarios of the objective, with the bounds on loads, as arrays.

        Raises:
          InvalidInput: a Reynolds number is outside the scene's range.
        """
        scenarios = self.objective.scenarios(self.scene)
        for reynolds in () if self.by_chord else scenarios.reynolds:
            self.scene.check_reynolds(reynolds)
        if not self.scene.family.has_lift:
            return scenarios
        bounds = {
            name: -bound.sense * UNBOUNDED if getattr(self, name) is None else getattr(self, name)
            for name, bound in LOAD_BOUNDS.items()
        }
        bounds["lift"] = self.objective.lifts or bounds["lift"]
        missing = max(LEAST_GAP - (bounds["max_moment"] - bounds["min_moment"]), 0.0)
        bounds["min_moment"] -= missing / 2
        bounds["max_moment"] += missing / 2
        rows = [np.broadcast_to(bound, len(scenarios.weight)) for bound in bounds.values()]
        return scenarios._replace(load_bounds=np.array(rows, float))

    @property
    def is_about_lift(self) -> bool:
        """Whether the objective is the glide ratio, or lift or moment have a bound."""
        bounded = any(getattr(self, name) is not None for name in LOAD_BOUNDS)
        return bounded or bool(self.objective.lifts) or bool(self.scenarios.glide)

    @property
    def variables(self) -> tuple[str, ...]:
        """The names of the variables of the search: the parameters, then the objective's own."""
        return self.objective.variables(self.scene)

    def body(
        self, variables: Float[AnyArray, "*bodies variables"]
    ) -> Float[AnyArray, "*bodies parameters"]:
        """Return the parameters of the body from variables of the search, without other changes.

        Where each case has an incidence of its own, it is that of the first case.
        """
        return variables[..., : len(self.scene.family.names)]

    @property
    def load_bound_names(self) -> list[str]:
        """The names of the bounds in the order of the values of ``load_constraints``.

        They are fields, as "max_moment", and the lifts of the objective's cases, as "lift 0.3".
        """
        cases, lifts = len(self.scenarios.weight), self.objective.lifts
        names = {name: [name] * cases for name in LOAD_BOUNDS if self.scene.family.has_lift}
        if lifts:
            names["lift"] = [f"lift {lift:g}" for lift in lifts]
        return [name for row in names.values() for name in row]

    def bound_text(self, name: str) -> str:
        """Return one of the ``load_bound_names`` with its value, as "max moment 0.1"."""
        return f"{name.replace('_', ' ')} {getattr(self, name):g}" if name in LOAD_BOUNDS else name

    @functools.cached_property
    def limits(self) -> Limits:
        """The ranges of the parameters and the constraints on the body, as arrays."""
        bounds = {}
        for name, bound in BOUNDS.items():
            given = getattr(self, name)
            if given is not None or not bound.optional:
                bounds[name] = np.asarray(bound.unbounded if given is None else given)
        stations = np.array(self.stations, float).reshape(-1, 2)
        return Limits(*self._ranges(), self.scenarios.shift, bounds, stations, self.reference)

    def at_range_ends(self, variables: Float[AnyArray, " variables"]) -> list[str]:
        """Return the names of the variables that lie at an end of their range, if it has a width.

        A wider range may have a better body.

        Args:
          variables: of a design, in the order of ``variables``.
        """
        low, high = self._ranges()
        nearest = np.minimum(np.asarray(variables) - low, high - np.asarray(variables))
        ends = (high > low) & (nearest <= RANGE_END * (high - low))
        return [name for name, end in zip(self.variables, ends, strict=True) if end]

    def _ranges(self) -> tuple[Float[np.ndarray, " variables"], Float[np.ndarray, " variables"]]:
        """Return the variables' ranges after the objective, ``within``, ``trust`` and changes."""
        family = self.scene.family
        low, high = family.bounds.T
        inset = np.maximum(self.trust * (high - low), np.abs(self.scenarios.shift).max(axis=0))
        low, high = low + inset, high - inset
        for name, value in self.objective.fixed_parameters(self.scene).items():
            low[family.names.index(name)] = high[family.names.index(name)] = value
        narrower = list((self.within or {}).items())
        if self.by_chord:
            flows = self.scenarios.reynolds, self.scene.reynolds
            narrower.append(("aspect", covered_aspects(*flows)))
        for name, (least, most) in narrower:
            k = family.names.index(name)
            low[k], high[k] = max(low[k], least), min(high[k], most)
        parameter = np.zeros(len(self.variables), int)  # which of them a variable is
        parameter[self.scenarios.variable] = np.arange(len(low))
        return low[parameter], high[parameter]

    def _check_by_chord(self):
        if self.scene.dimension != 2:
            raise InvalidInput(
                "by chord: is for 2-D bodies; coefficients of 3-D ones are over areas"
            )
        if self.scene.stream != Unbounded():
            raise InvalidInput("by chord: is for unbounded streams; the height of tunnels is in D")
        if self.max_length is not None:
            raise InvalidInput(
                "max length: at fixed chord all bodies have the length 1 c; bound the thickness"
            )
        if not isinstance(self.objective, AtReynolds):
            kind = type(self.objective).__name__
            raise InvalidInput(
                f"by chord: goes with a single Reynolds number without spread, not with {kind}"
            )
        if not self.objective.nominal > 0:
            raise InvalidInput(f"chord Reynolds number {self.objective.nominal:g}: must be above 0")
        needed = covered_aspects(self.scenarios.reynolds, self.scene.reynolds)
        aspects = dict(self.scene.family.ranges)["aspect"]
        if max(needed[0], aspects[0]) > min(needed[1], aspects[1]):
            ends = np.sqrt(aspects) * self.scene.reynolds
            raise InvalidInput(
                f"chord Reynolds number {self.objective.nominal:g}: the family and the "
                f"scene's range cover {ends[0]:.3g} to {ends[1]:.3g}"
            )

    def _check_ranges(self):
        trained, held = dict(self.scene.family.ranges), self.objective.fixed_parameters(self.scene)
        for name, value in (self.within or {}).items():
            if name not in trained:
                hint = did_you_mean(name, trained)
                raise InvalidInput(f"range of {name}: the family has {', '.join(trained)}{hint}")
            (least, most), (low, high) = value, trained[name]
            if not low - 1e-9 <= least <= most <= high + 1e-9:
                raise InvalidInput(
                    f"range of {name} {least:g} to {most:g}: must lie within the family's, "
                    f"{low:g} to {high:g}"
                )
            if name in held and not least == most == held[name]:
                raise InvalidInput(f"range of {name}: the objective holds it at {held[name]:g}")
        for name, low, high in zip(self.variables, *self._ranges(), strict=True):
            if low > high:
                raise InvalidInput(
                    f"{name}: its range and trust {self.trust:g} (or the tolerance, or the "
                    "chord Reynolds number) contradict each other; relax one of them"
                )
