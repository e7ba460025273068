"""The plot a reader remembers: cumulative cost against designs, crossings marked."""

import math
from pathlib import Path

from shapeopt.payoff.payoff import Payoff
from shapeopt.render.figures import plt, save_figure


def plot_payoff(payoffs: list[Payoff], path: str | Path) -> Path:
    """Draw wall seconds and applications of G against the number of designs."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    for axis, unit, quantity in zip(
        axes, ("seconds", "green_applications"), ("wall seconds", "applications of G"), strict=True
    ):
        crossings = [k for p in payoffs if math.isfinite(k := _crossing(p, unit))]
        most = max([10.0, *(3 * k for k in crossings)])
        designs = [most ** (k / 100) for k in range(101)]
        direct = getattr(payoffs[0].per_direct, unit)
        axis.plot(designs, [k * direct for k in designs], "k--", label="direct (adjoint)")
        for payoff in payoffs:
            bill, each = getattr(payoff.training, unit), getattr(payoff.per_design, unit)
            k = _crossing(payoff, unit)
            label = f"{payoff.method}, pays after {k:.0f}" if math.isfinite(k) else payoff.method
            (line,) = axis.plot(designs, [bill + k * each for k in designs], label=label)
            if math.isfinite(k):
                axis.plot(k, k * direct, "o", color=line.get_color())
        axis.set(xscale="log", yscale="log", xlabel="designs", ylabel=f"cumulative {quantity}")
        axis.legend(frameon=False)
    return save_figure(figure, path)


def _crossing(payoff, unit):
    return getattr(payoff, unit).designs
