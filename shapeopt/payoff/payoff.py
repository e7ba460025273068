"""The payoff: a training's bill against what it saves on every design."""

import dataclasses
import math
import statistics
from collections.abc import Sequence
from typing import Literal

import numpy as np

Unit = Literal["seconds", "green_applications"]
RESAMPLES = 2000


@dataclasses.dataclass(frozen=True)
class Bill:
    """Wall seconds and applications of G."""

    seconds: float
    green_applications: float


@dataclasses.dataclass(frozen=True)
class Answer:
    """One query answered: what it cost, and its verified drag beside the direct optimum's."""

    cost: Bill
    drag: float
    direct_cost: Bill
    direct_drag: float

    @property
    def gap(self) -> float:
        """Relative excess of the verified drag over the direct optimum's; negative is better."""
        return self.drag / self.direct_drag - 1


@dataclasses.dataclass(frozen=True)
class Campaign:
    """One trained surrogate (one seed) and the stream of queries it answered."""

    training: Bill
    drag_error_mean: float
    drag_error_max: float
    designs: Sequence[Answer]


@dataclasses.dataclass(frozen=True)
class BreakEven:
    """Designs after which the training has paid, with a 95 % interval; infinite if never."""

    designs: float
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class Payoff:
    """Break-even of one method over a stream of designs, its seeds taken together."""

    method: str
    training: Bill
    drag_error_mean: float
    drag_error_max: float
    gap_mean: float
    gap_max: float
    per_design: Bill
    per_direct: Bill
    seconds: BreakEven
    green_applications: BreakEven


def payoff(method: str, campaigns: Sequence[Campaign], seed: int = 0) -> Payoff:
    """K T_direct = T_train + K (T_loop + T_verify), solved for K by mean costs.

    The interval is a bootstrap over seeds and over the queries they share (Efron 1979).
    """
    designs = [design for campaign in campaigns for design in campaign.designs]
    gaps = [design.gap for design in designs]
    return Payoff(
        method=method,
        training=_mean([campaign.training for campaign in campaigns]),
        drag_error_mean=statistics.fmean(campaign.drag_error_mean for campaign in campaigns),
        drag_error_max=max(campaign.drag_error_max for campaign in campaigns),
        gap_mean=statistics.fmean(gaps),
        gap_max=max(gaps),
        per_design=_mean([design.cost for design in designs]),
        per_direct=_mean([design.direct_cost for design in designs]),
        seconds=_break_even(campaigns, "seconds", seed),
        green_applications=_break_even(campaigns, "green_applications", seed),
    )


def break_even(training: float, own: float, direct: float) -> float:
    """Number of designs after which training + K own <= K direct."""
    return training / (direct - own) if direct > own else math.inf


def _break_even(campaigns, unit: Unit, seed) -> BreakEven:
    generator = np.random.default_rng(seed)
    bills = np.array([getattr(campaign.training, unit) for campaign in campaigns])
    saved = np.array(
        [
            [getattr(design.direct_cost, unit) - getattr(design.cost, unit) for design in c.designs]
            for c in campaigns
        ]
    )
    seeds, queries = saved.shape

    def resampled():
        chosen = generator.integers(seeds, size=seeds)
        asked = generator.integers(queries, size=queries)
        return break_even(bills[chosen].mean(), 0.0, saved[np.ix_(chosen, asked)].mean())

    low, high = np.quantile([resampled() for _ in range(RESAMPLES)], [0.025, 0.975], method="lower")
    return BreakEven(break_even(bills.mean(), 0.0, saved.mean()), float(low), float(high))


def _mean(costs):
    return Bill(
        statistics.fmean(cost.seconds for cost in costs),
        statistics.fmean(cost.green_applications for cost in costs),
    )
