"""What is to be least: drag at one Reynolds number, over several, or under uncertainty.

Every objective comes down to scenarios (a Reynolds number, a change of shape, a weight) and to
one number made of their drags, so search, flow and verification share one definition.
"""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy import stats

from shapeopt.problem.uncertainty import LogNormal, Uniform, latin_hypercube
from surrogate.arrays import AnyArray, Number
from surrogate.checks import expect, finite_number, whole_number
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene

DEVIATIONS = 2.0  # where the normal changes of shape are cut off
FLOATS = {"reynolds": "Reynolds number", "level": "CVaR level", "tolerance": "tolerance"}
LEAST_KEPT = 0.5 - 1e-6  # of the spread's probability that must lie in the trained range


class Scenarios(NamedTuple):
    """Cases to be weighed; ``weight`` sums to 1.

    ``relative``: drags count over those of the ``round_body``, cylinder or sphere, at that Re.
    ``level``: the mean is taken over the worst 1 - level of the cases.
    """

    shift: Float[AnyArray, "cases parameters"]
    reynolds: Float[AnyArray, " cases"]
    weight: Float[AnyArray, " cases"]
    relative: Bool[AnyArray, ""]
    level: Float[AnyArray, ""]
    round_body: Float[AnyArray, " parameters"]


@dataclasses.dataclass(frozen=True)
class AtReynolds:
    """Cd at one Reynolds number."""

    reynolds: float

    @property
    def nominal(self) -> float:
        return self.reynolds

    def scenarios(self, scene: Scene) -> Scenarios:
        return _scenarios(scene, [scene.check_reynolds(self.reynolds)], [1.0])


@dataclasses.dataclass(frozen=True)
class Weighted:
    """Weighted mean over Reynolds numbers of Cd / Cd of the cylinder at that Re.

    Relative, because Cd falls tenfold from Re 1 to 40: a mean of Cd would hear low Re only.
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
        if not all(finite_number("weight", weight) > 0 for weight in self.weights):
            raise InvalidInput("weights: every one must be a finite number above 0")

    @property
    def nominal(self) -> float:
        """The Reynolds number of the greatest weight."""
        return self.reynolds[int(np.argmax(self.weights))]

    def scenarios(self, scene: Scene) -> Scenarios:
        reynolds = [scene.check_reynolds(value) for value in self.reynolds]
        weight = np.array(self.weights) / max(self.weights)
        weight /= weight.sum()
        return _scenarios(scene, reynolds, weight, relative=True)


@dataclasses.dataclass(frozen=True)
class Robust:
    """Cd under an uncertain Re and an inexact shape: its mean, or the mean of its worst cases.

    ``spread`` is the distribution of Re, cut off at the edges of the trained range and renormed.
    ``tolerance`` is the standard deviation of every shape parameter over the width of its range,
    normal and cut off at two deviations; bodies keep so far from the edges that no case leaves the
    trained ranges. ``level`` 0 is the mean, 0.9 the mean of the worst tenth (CVaR, Rockafellar
    and Uryasev 2000). One ``seed`` draws the same ``cases`` for every body (Latin hypercube).
    """

    reynolds: Number
    spread: LogNormal | Uniform
    tolerance: Number = 0.0
    level: Number = 0.0
    cases: int = 32
    seed: int = 0

    def __post_init__(self):
        expect("spread", self.spread, LogNormal | Uniform, "distribution, as LogNormal(0.2)")
        for name, told in FLOATS.items():
            object.__setattr__(self, name, finite_number(told, getattr(self, name)))
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
        """Probability of the spread that lies within the trained range."""
        return float(np.ptp(self._ends(scene)))

    def scenarios(self, scene: Scene) -> Scenarios:
        nominal, kept = scene.check_reynolds(self.reynolds), self.kept(scene)
        if kept < LEAST_KEPT:
            raise InvalidInput(
                f"spread {self.spread.spread:g} about Re {nominal:g}: only "
                f"{100 * kept:.0f} % of it lies within the trained range; at least half must"
            )
        width = np.ptp(scene.family.bounds, axis=1)
        fractions = latin_hypercube(self.seed, self.cases, 1 + len(width))
        reynolds = np.full(self.cases, nominal)
        if self.spread.spread:
            place = self._ends(scene)[0] + kept * fractions[:, 0]
            reynolds = self.spread.around(nominal).ppf(place)
        reynolds = np.clip(reynolds, *scene.reynolds)  # rounding alone
        normal = stats.truncnorm(-DEVIATIONS, DEVIATIONS).ppf(fractions[:, 1:])
        weight = np.full(self.cases, 1 / self.cases)
        shift = self.tolerance * width * normal
        return _scenarios(scene, reynolds, weight, shift, level=self.level)

    def _ends(self, scene):
        """Probabilities below both ends of the trained range."""
        if not self.spread.spread:
            return 0.0, 1.0
        return tuple(self.spread.around(self.reynolds).cdf(scene.reynolds).tolist())


Objective = AtReynolds | Weighted | Robust


def combine(
    drags: Float[AnyArray, " cases"],
    cylinder: Float[AnyArray, " cases"],
    scenarios: Scenarios,
) -> Float[Array, ""]:
    """The objective from the drags of all scenarios, and the cylinder's at the same Re."""
    losses = drags / jnp.where(scenarios.relative, cylinder, 1.0)
    return conditional_value_at_risk(losses, scenarios.weight, scenarios.level)


def conditional_value_at_risk(
    losses: Float[AnyArray, " cases"], weight: Float[AnyArray, " cases"], level: AnyArray | float
) -> Float[Array, ""]:
    """Mean of the worst 1 - level of the losses, a case at the border counted in part.

    The least over t of t + E max(loss - t, 0) / (1 - level), in closed form.
    """
    order = jnp.argsort(-losses)
    weight = weight[order]
    worse = jnp.cumsum(weight) - weight
    tail = jnp.clip(1 - level - worse, 0, weight)
    return tail @ losses[order] / (1 - level)


def predicted(
    model: Any, parameters: Float[AnyArray, " parameters"], scenarios: Scenarios
) -> Float[Array, ""]:
    """The objective as a model sees it: pure, differentiable, to be vmapped over bodies."""
    return combine(*predicted_drags(model, parameters, scenarios), scenarios)


def predicted_drags(
    model: Any, parameters: Float[AnyArray, " parameters"], scenarios: Scenarios
) -> tuple[Float[Array, " cases"], Float[Array, " cases"]]:
    """Cd of a body and of the cylinder in every scenario."""
    drags = jax.vmap(model.drag)(parameters + scenarios.shift, scenarios.reynolds)
    cylinder = jax.vmap(model.drag, in_axes=(None, 0))(scenarios.round_body, scenarios.reynolds)
    return drags, cylinder


def _scenarios(scene, reynolds, weight, shift=None, relative=False, level=0.0):
    if shift is None:
        shift = np.zeros((len(reynolds), len(scene.family.names)))
    values = (shift, reynolds, weight)
    return Scenarios(
        *(np.asarray(value, float) for value in values),
        np.asarray(relative),
        np.asarray(level),
        scene.family.ellipse(1.0),
    )
