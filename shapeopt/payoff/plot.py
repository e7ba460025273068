"""The plot a reader remembers: cumulative cost, from the first design to the thousandth."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeopt.payoff.payoff import UNITS, Way
from shapeopt.render.figures import plt, save_figure

MOST = 1000
QUANTITIES = {"seconds": "wall seconds", "green_applications": "applications of G"}
PLAIN = {"direct": "k--", "direct, from the nearest answer": "k:", "growing kriging": "k-"}


def plot_payoff(ways: Sequence[Way], path: str | Path) -> Path:
    """Draw applications of G and wall seconds against the number of designs."""
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
    designs = np.arange(1, MOST + 1)
    for axis, unit in zip(axes, reversed(UNITS), strict=True):
        colours = iter(plt.rcParams["axes.prop_cycle"].by_key()["color"] * 2)
        for way in ways:
            style = {"linestyle": ":" if "published" in way.name else "-"}
            if way.name not in PLAIN:
                style["color"] = next(colours)
            axis.plot(
                designs,
                way.cumulative(unit, MOST),
                *[PLAIN[way.name]] if way.name in PLAIN else [],
                label=way.name,
                **(style if way.name not in PLAIN else {}),
            )
        axis.set(xscale="log", yscale="log", xlabel="designs of equal quality")
        axis.set(ylabel=f"cumulative {QUANTITIES[unit]}")
    axes[1].legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return save_figure(figure, path)
