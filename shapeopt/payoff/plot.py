"""The plot a reader remembers: cumulative cost, from the first design to the thousandth."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeopt.payoff.break_even import UNITS, Strategy
from shapeopt.render.figures import plt, save_figure

MOST = 1000
QUANTITIES = {"seconds": "wall seconds", "green_applications": "applications of G"}
PLAIN = {"direct": "--", "direct, from the nearest answer": ":", "growing kriging": "-"}
VARIANTS = {"as published": ":", "bodies": "--", "and kriging": "-."}  # the rest is at its best


def plot_payoff(ways: Sequence[Strategy], path: str | Path) -> Path:
    """Draw applications of G and wall seconds against the number of designs."""
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
    designs, methods = np.arange(1, MOST + 1), dict.fromkeys(_method(way) for way in ways)
    colours = {method: f"C{k}" for k, method in enumerate(m for m in methods if m)}
    for axis, unit in zip(axes, reversed(UNITS), strict=True):
        for way in ways:
            look = {"color": colours.get(_method(way), "black"), "linestyle": _dashes(way)}
            axis.plot(designs, way.cumulative(unit, MOST), label=way.name, **look)
        axis.set(xscale="log", yscale="log", xlabel="designs of equal quality")
        axis.set(ylabel=f"cumulative {QUANTITIES[unit]}")
    axes[1].legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return save_figure(figure, path)


def _method(way):
    return None if way.name in PLAIN else way.name.split(",")[0]


def _dashes(way):
    if way.name in PLAIN:
        return PLAIN[way.name]
    return next((style for words, style in VARIANTS.items() if words in way.name), "-")
