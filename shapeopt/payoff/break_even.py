"""The payoff: a training's bill against what it saves on every design of equal quality."""

import dataclasses
import math
import statistics
from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float

from shapeopt.search.design import Design

Unit = Literal["seconds", "green_applications"]
UNITS: tuple[Unit, ...] = ("seconds", "green_applications")
RESAMPLES = 2000
LATE = 5  # designs at the end of a stream that say what all later ones cost


@dataclasses.dataclass(frozen=True)
class Cost:
    """Wall seconds and applications of G."""

    seconds: float = 0.0
    green_applications: float = 0.0


@dataclasses.dataclass(frozen=True)
class Strategy:
    """One way to answer a stream of queries: its trainings and its designs, one row a seed.

    What remembers its flows (``remembers``) gets cheaper from design to design; other ways cost
    the same for every query whenever it comes.
    """

    name: str
    trainings: Sequence[Cost]
    designs: Sequence[Sequence[Design]]
    remembers: bool = False
    drag_error_mean: float | None = None
    drag_error_max: float | None = None

    def costs(self, unit: Unit) -> Float[np.ndarray, "seeds queries"]:
        """Of every design."""
        return np.array([[getattr(d, unit) for d in row] for row in self.designs], float)

    def bills(self, unit: Unit) -> Float[np.ndarray, " seeds"]:
        """Of the trainings."""
        return np.array([getattr(bill, unit) for bill in self.trainings], float)

    def cumulative(self, unit: Unit, count: int) -> Float[np.ndarray, " designs"]:
        """Cost and designs together after 1, 2, ... designs, the seeds' mean.

        Beyond the stream a design costs what the last of them did, or the mean of them all.
        """
        costs = self.costs(unit).mean(axis=0)
        late = costs[-LATE:].mean() if self.remembers else costs.mean()
        if not self.remembers:
            costs = np.full_like(costs, late)
        each = np.concatenate([costs, np.full(max(count - costs.size, 0), late)])[:count]
        return self.bills(unit).mean() + np.cumsum(each)


@dataclasses.dataclass(frozen=True)
class BreakEven:
    """Designs after which a training has paid, with a 95 % interval; infinite if never."""

    designs: float
    low: float
    high: float


def break_even(training: float, own: float, direct: float) -> float:
    """Number of designs after which training + K own <= K direct."""
    return training / (direct - own) if direct > own else math.inf


def pays_after(way: Strategy, direct: Strategy, unit: Unit, seed: int = 0) -> BreakEven:
    """Break-even by mean costs; the interval is a bootstrap over seeds and queries (Efron 1979)."""
    generator, bills = np.random.default_rng(seed), way.bills(unit)
    saved = direct.costs(unit).mean(axis=0) - way.costs(unit)
    seeds, queries = saved.shape

    def resampled():
        chosen = generator.integers(seeds, size=seeds)
        asked = generator.integers(queries, size=queries)
        return break_even(bills[chosen].mean(), 0.0, saved[np.ix_(chosen, asked)].mean())

    low, high = np.quantile([resampled() for _ in range(RESAMPLES)], [0.025, 0.975], method="lower")
    return BreakEven(break_even(bills.mean(), 0.0, saved.mean()), float(low), float(high))


def overtakes(way: Strategy, rival: Strategy, unit: Unit, most: int = 1000) -> int | None:
    """First number of designs at which the way has cost no more than the rival; None if none."""
    ahead = way.cumulative(unit, most) <= rival.cumulative(unit, most)
    return int(np.argmax(ahead)) + 1 if ahead.any() else None


def best_known(ways: Sequence[Strategy]) -> Float[np.ndarray, " queries"]:
    """The least objective that any way has found, of every query."""
    return np.min([[d.objective for d in row] for way in ways for row in way.designs], axis=0)


def per_design(way: Strategy) -> dict[str, float]:
    """Mean flows, work and seconds of a design."""
    designs = [design for row in way.designs for design in row]
    return {
        "flows_per_design": statistics.fmean(design.flows for design in designs),
        "g_per_design": float(way.costs("green_applications").mean()),
        "s_per_design": float(way.costs("seconds").mean()),
    }


def quality(way: Strategy, best: Float[np.ndarray, " queries"]) -> dict[str, float]:
    """How far its designs are from optimal: KKT residuals, excess over the best that is known."""
    gaps = [[d.objective for d in row] / best - 1 for row in way.designs]
    return {
        "kkt_max": max(design.kkt_residual for row in way.designs for design in row),
        "gap_mean": float(np.mean(gaps)),
        "gap_max": float(np.max(gaps)),
    }
