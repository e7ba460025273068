"""Break-even: the cost of a training against what it saves on every design of equal quality."""

import dataclasses
import math
import statistics
from collections.abc import Collection, Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float

from shapeopt.search.design import Design
from surrogate.errors import NotConverged

Unit = Literal["seconds", "green_applications"]
UNITS: tuple[Unit, ...] = ("seconds", "green_applications")
RESAMPLES = 2000
MOST_DESIGNS = 1000  # up to which costs are compared
LATE = 5  # designs at the end of a stream whose mean cost stands for all later ones


@dataclasses.dataclass(frozen=True)
class Cost:
    """The cost of a training: wall seconds, and convolutions with the Green's function (G)."""

    seconds: float = 0.0
    green_applications: float = 0.0


@dataclasses.dataclass(frozen=True)
class Strategy:
    """A strategy that answers a stream of design problems (queries), with its answers and its cost.

    Attributes:
      name: as in the tables.
      trainings: cost of the training, for each seed.
      designs: the answers, one row for each seed; in place of a design that was not found, why.
      keeps_flows: whether flows are kept from query to query, so that designs get cheaper; else
        the order of the queries does not matter.
      drag_error_mean: mean relative drag error of the trained networks.
      drag_error_max: the largest one.
    """

    name: str
    trainings: Sequence[Cost]
    designs: Sequence[Sequence[Design | NotConverged]]
    keeps_flows: bool = False
    drag_error_mean: float | None = None
    drag_error_max: float | None = None

    def without(self, queries: Collection[int]) -> "Strategy":
        """Return the same strategy without its answers to the queries of these indices."""
        kept = [[d for k, d in enumerate(row) if k not in queries] for row in self.designs]
        return dataclasses.replace(self, designs=kept)

    def design_costs(self, unit: Unit) -> Float[np.ndarray, "seeds queries"]:
        """Return the cost of every design, in seconds or in convolutions (G)."""
        return np.array([[getattr(d, unit) for d in row] for row in self.designs], float)

    def training_costs(self, unit: Unit) -> Float[np.ndarray, " seeds"]:
        """Return the cost of the training for each seed, in seconds or in convolutions (G)."""
        return np.array([getattr(cost, unit) for cost in self.trainings], float)

    def cumulative(self, unit: Unit, count: int) -> Float[np.ndarray, " designs"]:
        """Return the cumulative cost after 1, 2, ..., ``count`` designs, training included.

        It is a mean over the seeds. Where flows are kept, designs beyond the stream cost the mean
        of its last ``LATE``; otherwise every design costs the mean of all.
        """
        costs = self.design_costs(unit).mean(axis=0)
        late = costs[-LATE:].mean() if self.keeps_flows else costs.mean()
        if not self.keeps_flows:
            costs = np.full_like(costs, late)
        each = np.concatenate([costs, np.full(max(count - costs.size, 0), late)])[:count]
        return self.training_costs(unit).mean() + np.cumsum(each)


@dataclasses.dataclass(frozen=True)
class BreakEven:
    """The number of designs after which a training has paid, with a 95 % interval; inf if never."""

    designs: float
    low: float
    high: float


def break_even(training: float, own: float, direct: float) -> float:
    """Return the number of designs K at which training + K own = K direct; inf if own >= direct."""
    return training / (direct - own) if direct > own else math.inf


def pays_after(strategy: Strategy, direct: Strategy, unit: Unit, seed: int = 0) -> BreakEven:
    """Return the break-even of mean costs with its interval, see ``resampled_break_even``.

    Args:
      strategy: whose training is to pay.
      direct: the strategy without training to which it is compared, on the same queries.
      unit: of the costs.
      seed: of the resampling.
    """
    saved = direct.design_costs(unit).mean(axis=0) - strategy.design_costs(unit)
    return resampled_break_even(strategy.training_costs(unit), saved, seed)


def resampled_break_even(
    training: Float[np.ndarray, " seeds"], saved: Float[np.ndarray, "seeds queries"], seed: int = 0
) -> BreakEven:
    """Return the break-even of mean costs, with a percentile bootstrap interval (Efron 1979).

    Seeds and queries are resampled independently. ``scipy.stats.bootstrap`` is not used because it
    refuses a single seed and interpolates between break-evens that may be infinite.

    Args:
      training: cost of the training, for each seed.
      saved: what each design saves against the strategy without training.
      seed: of the resampling.
    """
    generator, (seeds, queries) = np.random.default_rng(seed), saved.shape

    def resampled():
        chosen = generator.integers(seeds, size=seeds)
        drawn = generator.integers(queries, size=queries)
        return break_even(training[chosen].mean(), 0.0, saved[np.ix_(chosen, drawn)].mean())

    low, high = np.quantile([resampled() for _ in range(RESAMPLES)], [0.025, 0.975], method="lower")
    return BreakEven(break_even(training.mean(), 0.0, saved.mean()), float(low), float(high))


def overtakes(strategy: Strategy, rival: Strategy, unit: Unit) -> int | None:
    """Return the first number of designs at which a strategy costs no more than its rival.

    Args:
      strategy: with or without training.
      rival: the strategy to which it is compared.
      unit: of the cumulative costs, training included.

    Returns:
      The number; None if the strategy costs more up to ``MOST_DESIGNS``.
    """
    ahead = strategy.cumulative(unit, MOST_DESIGNS) <= rival.cumulative(unit, MOST_DESIGNS)
    return int(np.argmax(ahead)) + 1 if ahead.any() else None


def best_known(strategies: Sequence[Strategy]) -> Float[np.ndarray, " queries"]:
    """Return the least objective that any strategy has found, for every query."""
    return np.min([[d.objective for d in row] for s in strategies for row in s.designs], axis=0)


def per_design(strategy: Strategy) -> dict[str, float]:
    """Return the mean number of flows, convolutions (G) and wall seconds of a design."""
    designs = [design for row in strategy.designs for design in row]
    return {
        "flows_per_design": statistics.fmean(design.flows for design in designs),
        "g_per_design": float(strategy.design_costs("green_applications").mean()),
        "s_per_design": float(strategy.design_costs("seconds").mean()),
    }


def quality(strategy: Strategy, best: Float[np.ndarray, " queries"]) -> dict[str, float]:
    """Return the largest KKT residual, and the mean and largest relative excess over ``best``.

    ``best`` is the least known objective of every query, see ``best_known``.
    """
    gaps = [([d.objective for d in row] - best) / np.abs(best) for row in strategy.designs]
    return {
        "kkt_max": max(design.kkt_residual for row in strategy.designs for design in row),
        "gap_mean": float(np.mean(gaps)),
        "gap_max": float(np.max(gaps)),
    }
