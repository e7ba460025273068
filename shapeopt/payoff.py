"""The payoff: a training's bill against what it saves on every design."""

import dataclasses
import math
import statistics


@dataclasses.dataclass(frozen=True)
class Cost:
    """Wall seconds and applications of G."""

    seconds: float
    green_applications: float

    def __add__(self, other: "Cost") -> "Cost":
        return Cost(
            self.seconds + other.seconds, self.green_applications + other.green_applications
        )


@dataclasses.dataclass(frozen=True)
class Design:
    """One query answered: what it cost, and its verified drag beside the direct optimum's."""

    cost: Cost
    drag: float
    direct_cost: Cost
    direct_drag: float

    @property
    def gap(self) -> float:
        """Relative excess of the verified drag over the direct optimum's; negative is better."""
        return self.drag / self.direct_drag - 1


@dataclasses.dataclass(frozen=True)
class Payoff:
    """Break-even of one method over a stream of designs; infinite where it never pays."""

    method: str
    training: Cost
    drag_error_mean: float
    drag_error_max: float
    gap_mean: float
    gap_max: float
    per_design: Cost
    per_direct: Cost
    designs_to_pay_seconds: float
    designs_to_pay_green: float


def payoff(
    method: str, training: Cost, errors: tuple[float, float], designs: list[Design]
) -> Payoff:
    """K T_direct = T_train + K (T_loop + T_verify), solved for K by mean costs per design."""
    own = _mean([design.cost for design in designs])
    direct = _mean([design.direct_cost for design in designs])
    gaps = [design.gap for design in designs]
    return Payoff(
        method=method,
        training=training,
        drag_error_mean=errors[0],
        drag_error_max=errors[1],
        gap_mean=statistics.fmean(gaps),
        gap_max=max(gaps),
        per_design=own,
        per_direct=direct,
        designs_to_pay_seconds=break_even(training.seconds, own.seconds, direct.seconds),
        designs_to_pay_green=break_even(
            training.green_applications, own.green_applications, direct.green_applications
        ),
    )


def break_even(training: float, own: float, direct: float) -> float:
    """Number of designs after which training + K own <= K direct."""
    return training / (direct - own) if direct > own else math.inf


def _mean(costs):
    return Cost(
        statistics.fmean(cost.seconds for cost in costs),
        statistics.fmean(cost.green_applications for cost in costs),
    )
