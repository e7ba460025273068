"""Objectives: drag at one Reynolds number or at several, and the glide ratio.

An objective states its scenarios; ``shapeopt.problem.scenarios`` makes one number of their loads.
A new objective is a subclass of ``Objective``, here or in a file of its own as ``robust``.
"""

import abc
import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar

import jax
import numpy as np
from jaxtyping import Float

from shapeopt.problem.scenarios import NO_LIFT, Scenarios
from surrogate.arrays import AnyArray, Number
from surrogate.checks import expect, finite_number, shown
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene


class Objective(abc.ABC):
    """An objective to be minimised: one number made of the loads over scenarios.

    ``fixed`` says whether the scenarios are known before the search; otherwise each optimum has a
    ``following`` objective, until there is none (``shapeopt.search.following``). ``lifts`` are
    lower bounds on Cl that differ from scenario to scenario; none by default.
    """

    fixed: ClassVar[bool] = True
    lifts: tuple[float, ...] = ()

    @property
    @abc.abstractmethod
    def nominal(self) -> float:
        """The Reynolds number at which a design's Cd is reported."""

    @abc.abstractmethod
    def scenarios(self, scene: Scene) -> Scenarios:
        """Return the cases of the objective in a scene, whose range of Re ``Problem`` checks.

        Raises:
          InvalidInput: the objective does not suit the scene.
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

    def fixed_parameters(self, scene: Scene) -> dict[str, float]:
        """Return the parameters by name that the objective holds at a value; none by default."""
        return {}

    def variables(self, scene: Scene) -> tuple[str, ...]:
        """Return the names of the variables of the search, by default the scene's parameters.

        Others may follow these, which take their place in some scenarios (``Scenarios.variable``).
        """
        return scene.family.names

    def record(self, scene: Scene) -> dict[str, Any]:
        """Return the settings that are stored with a run."""
        return {}


@dataclasses.dataclass(frozen=True)
class AtReynolds(Objective):
    """The objective Cd at one Reynolds number."""

    reynolds: Number

    def __post_init__(self):
        object.__setattr__(self, "reynolds", finite_number("Reynolds number", self.reynolds))

    @property
    def nominal(self) -> float:
        """The Reynolds number of the objective."""
        return self.reynolds

    def scenarios(self, scene: Scene) -> Scenarios:
        """Return the one scenario: the body itself at this Reynolds number."""
        return scenarios_of(scene, [self.reynolds], [1.0])


@dataclasses.dataclass(frozen=True)
class Glide(AtReynolds):
    """The glide ratio Cl / Cd at one Reynolds number, which is maximised: -Cl / Cd is minimised."""

    def scenarios(self, scene: Scene) -> Scenarios:
        """Return the one scenario, with the loss -Cl / Cd.

        Raises:
          InvalidInput: the scene's bodies have no lift.
        """
        return scenarios_of(scene, [self.reynolds], [1.0], glide=True)


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
        object.__setattr__(self, "reynolds", numbers_of("reynolds", self.reynolds))
        weights = checked_weights(self.weights, len(self.reynolds), "Reynolds numbers")
        object.__setattr__(self, "weights", weights)

    @property
    def nominal(self) -> float:
        """The Reynolds number of the largest weight."""
        return self.reynolds[int(np.argmax(self.weights))]

    def scenarios(self, scene: Scene) -> Scenarios:
        """Return one scenario for each Reynolds number, with Cd over the cylinder's (sphere's).

        Raises:
          InvalidInput: the scene's family lacks the cylinder (sphere).
        """
        family = scene.family
        if not family.contains(family.ellipse(1.0)):
            values = zip(family.ranges, family.ellipse(1.0).tolist(), strict=True)
            lacks = [f"{name} {x:g}" for (name, (low, high)), x in values if not low <= x <= high]
            raise InvalidInput(
                f"several Reynolds numbers: weighted drags are over the {family.round_body}'s, and "
                f"this family lacks {', '.join(lacks)}; ask for each Reynolds number by itself, or "
                "for an uncertain one (Robust, --spread), whose Cd is not divided"
            )
        return scenarios_of(scene, self.reynolds, shares(self.weights), relative=True)


def numbers_of(name: str, values: object) -> tuple[float, ...]:
    """Return a list of numbers as floats.

    Raises:
      InvalidInput: it is not a list of numbers.
    """
    expect(name, values, list | tuple | np.ndarray | jax.Array, "list of numbers")
    if not isinstance(values, list | tuple) and np.ndim(values) != 1:
        raise InvalidInput(f"{name} {shown(values)}: a list of numbers is needed")
    return tuple(finite_number(name, one) for one in values)


def checked_weights(given: object, count: int, points: str) -> tuple[float, ...]:
    """Return the weights of ``count`` points as floats.

    Args:
      given: the weights.
      count: of the points, at least 1.
      points: what they are, for the message.

    Raises:
      InvalidInput: they are not one number above 0 for each.
    """
    weights = numbers_of("weights", given)
    if not count:
        raise InvalidInput(f"{points}: at least one is needed")
    if len(weights) != count:
        raise InvalidInput(f"weights: {len(weights)} for {count} {points}; give one for each")
    if not all(weight > 0 for weight in weights):
        raise InvalidInput("weights: every one must be a finite number above 0")
    return weights


def shares(weights: Sequence[float]) -> Float[np.ndarray, " points"]:
    """Return weights divided by their sum; any of them may be as large as a float can be."""
    weight = np.array(weights) / max(weights)
    return weight / weight.sum()


def scenarios_of(
    scene: Scene,
    reynolds: Sequence[float] | Float[AnyArray, " cases"],
    weight: list[float] | Float[AnyArray, " cases"],
    shift: Float[AnyArray, "cases parameters"] | None = None,
    relative: bool = False,
    level: float = 0.0,
    glide: bool = False,
    force: bool = False,
) -> Scenarios:
    """Return scenarios at Reynolds numbers with weights, and with changes of shape if given.

    Args:
      scene: of the problem.
      reynolds: of the cases.
      weight: of the cases, with the sum 1.
      shift: changes of the parameters in each case; none by default.
      relative: whether the drag is over that of the cylinder (sphere).
      level: CVaR level.
      glide: whether the loss is -Cl / Cd.
      force: whether the loss is the magnitude of the force.

    Raises:
      InvalidInput: the loss is -Cl / Cd and the scene's bodies have no lift.
    """
    if glide and not scene.family.has_lift:
        raise InvalidInput(f"glide: {NO_LIFT}")
    if shift is None:
        shift = np.zeros((len(reynolds), len(scene.family.names)))
    return Scenarios(
        np.tile(np.arange(len(scene.family.names)), (len(reynolds), 1)),
        *(np.asarray(value, float) for value in (shift, reynolds, weight)),
        np.asarray(relative),
        np.asarray(glide),
        np.asarray(force),
        np.asarray(level),
        scene.family.ellipse(1.0),
        np.zeros((0, len(reynolds))),
    )
