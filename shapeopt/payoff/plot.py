"""Plot of the cumulative cost, training included, against the number of designs."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from shapeopt.payoff.break_even import MOST_DESIGNS, UNITS, Strategy
from shapeopt.render.figures import save_figure

QUANTITIES = {"seconds": "wall seconds", "green_applications": "convolutions (G)"}
# Line styles: strategies without training by name, the variants of a method by a word of theirs,
# and solid for a method at its best.
UNTRAINED = {"direct": "--", "direct, from the nearest answer": ":", "kriging with memory": "-"}
VARIANTS = {"as published": ":", "bodies": "--", "and kriging": "-."}


def plot_payoff(strategies: Sequence[Strategy], path: str | Path) -> Path:
    """Plot convolutions (G) and wall seconds against the number of designs, and return the path."""
    figure = Figure(figsize=(12, 4.6), layout="constrained")
    axes = figure.subplots(1, 2)
    designs = np.arange(1, MOST_DESIGNS + 1)
    methods = dict.fromkeys(_method(s.name) for s in strategies if s.name not in UNTRAINED)
    colours = {method: f"C{k}" for k, method in enumerate(methods)}
    for axis, unit in zip(axes, reversed(UNITS), strict=True):
        for s in strategies:
            colour = "black" if s.name in UNTRAINED else colours[_method(s.name)]
            look = {"color": colour, "linestyle": _line_style(s.name)}
            axis.plot(designs, s.cumulative(unit, MOST_DESIGNS), label=s.name, **look)
        axis.set(xscale="log", yscale="log", xlabel="designs of equal quality")
        axis.set(ylabel=f"cumulative {QUANTITIES[unit]}")
    axes[1].legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return save_figure(figure, path)


def _method(name: str) -> str:
    return name.split(",")[0]


def _line_style(name: str) -> str:
    if name in UNTRAINED:
        return UNTRAINED[name]
    return next((style for words, style in VARIANTS.items() if words in name), "-")
