"""An objective over several lifts: the drag of one section that works at all of them."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from shapeopt.problem.objective import Objective, checked_weights, numbers_of, scenarios_of, shares
from shapeopt.problem.scenarios import NO_LIFT, UNBOUNDED, Scenarios
from surrogate.arrays import Number
from surrogate.body.parameters import INCIDENCE
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene


@dataclasses.dataclass(frozen=True)
class MultiPoint(Objective):
    """The weighted mean Cd of one section over several lifts, at an incidence for each.

    This is the multipoint optimisation of a wing section: thickness and camber are the same at all
    lifts, and each has an incidence of its own, a variable of the search. The incidence among the
    parameters of a design is that of the first lift.

    Args:
      reynolds: Reynolds number at all lifts.
      lifts: two or more lower bounds on Cl, which differ in the first six digits.
      weights: positive weights of the lifts; only their ratios matter. Equal by default.
    """

    reynolds: Number
    # required: without ``field()`` the class attribute of ``Objective`` would be its default
    lifts: tuple[float, ...] = dataclasses.field()
    weights: Sequence[float] | None = None

    def __post_init__(self):
        object.__setattr__(self, "reynolds", finite_number("Reynolds number", self.reynolds))
        object.__setattr__(self, "lifts", numbers_of("lifts", self.lifts))
        if len({f"{lift:g}" for lift in self.lifts}) < max(len(self.lifts), 2):
            raise InvalidInput("lifts: two or more different lower bounds on Cl are needed")
        if not all(abs(lift) < UNBOUNDED for lift in self.lifts):
            raise InvalidInput(f"lifts: coefficients below {UNBOUNDED:g} in magnitude are needed")
        given = (1.0,) * len(self.lifts) if self.weights is None else self.weights
        object.__setattr__(self, "weights", checked_weights(given, len(self.lifts), "lifts"))

    @property
    def nominal(self) -> float:
        """The Reynolds number at all lifts."""
        return self.reynolds

    def scenarios(self, scene: Scene) -> Scenarios:
        """Return one scenario for each lift, with an incidence of its own.

        Raises:
          InvalidInput: the scene's bodies have no lift, or all of them lie at one incidence.
        """
        if not scene.family.has_lift:
            raise InvalidInput(f"lifts: {NO_LIFT}")
        names, count = scene.family.names, len(self.lifts)
        if INCIDENCE.name not in names:
            raise InvalidInput("lifts: bodies need an incidence, and this scene's have none")
        found = scenarios_of(scene, [self.reynolds] * count, shares(self.weights))
        found.variable[1:, names.index(INCIDENCE.name)] = len(names) + np.arange(count - 1)
        return found

    def variables(self, scene: Scene) -> tuple[str, ...]:
        """Return the names of the parameters, and of the incidences of all lifts but the first."""
        added = (f"{INCIDENCE.name} at lift {lift:g}" for lift in self.lifts[1:])
        return *scene.family.names, *added

    def record(self, scene: Scene) -> dict[str, Any]:
        """Return the lifts and their weights."""
        return {"lifts": list(self.lifts), "weights": list(self.weights)}
