"""Polars: Cl, Cd and Cm over incidence for each Reynolds number, or over the Reynolds number."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from shapeopt.render.figures import OPTIMUM, STYLE, save_figure
from surrogate.files import JsonObject
from surrogate.flow.output.palette import INK

LABELS = {
    "cd": "$C_d$",
    "cl": "$C_l$",
    "cm": "$C_m$",
    "incidence": "incidence, degrees",
    "reynolds": "Reynolds number $U D / \\nu$",
    "chord_reynolds": "Reynolds number $U c / \\nu$",
}
SYMBOLS = {"reynolds": "Re", "chord_reynolds": "chord Re"}
ERRORS = {
    "cd": "estimated_error",  # over Cd
    "cl": "estimated_lift_error",
    "cm": "estimated_moment_error",
}
PANELS = (("cd", "cl"), ("incidence", "cl"), ("incidence", "cd"), ("incidence", "cm"))


def plot_polar(rows: Sequence[JsonObject], title: str, path: str | Path) -> Path:
    """Plot the loads of one body's converged flows, and return the path of the picture.

    With several incidences, Cl over Cd, and Cl, Cd and Cm over incidence, a line for each Re. With
    one incidence Cd, and of a body with lift also Cl and Cm, over Re. Re is by the chord where the
    coefficients are. Bars are the bounds of the errors.

    Args:
      rows: with "incidence", "reynolds", "chord_reynolds", "reference", "cd", "cl", "cm", of which
        the coefficients are None where a flow did not converge; and with the bounds
        "estimated_error", of Cd over Cd, "estimated_lift_error" and "estimated_moment_error".
      title: of the figure.
      path: of the picture.
    """
    found = [row for row in rows if row["cd"] is not None]
    number = "chord_reynolds" if rows[0]["reference"] == "chord" else "reynolds"
    with rc_context(STYLE):
        if len({row["incidence"] for row in rows}) > 1:
            figure = _over_incidence(found, number)
        else:
            figure = _over_reynolds(found, number)
        figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
        return save_figure(figure, path)


def _over_incidence(rows: list[JsonObject], number: str) -> Figure:
    figure = Figure(figsize=(10, 7.6), layout="constrained")
    axes = figure.subplots(2, 2)
    reynolds = sorted({row[number] for row in rows})
    colours = colormaps["viridis"](np.linspace(0.1, 0.8, len(reynolds)))
    for axis, (x, y) in zip(axes.flat, PANELS, strict=True):
        for value, colour in zip(reynolds, colours, strict=True):
            line = sorted((r for r in rows if r[number] == value), key=lambda r: r["incidence"])
            _draw(axis, line, x, y, color=colour, label=f"{SYMBOLS[number]} {value:.4g}")
        if y != "cd":
            axis.axhline(0, color=INK, lw=0.6)
    axes[0, 0].legend()
    return figure


def _over_reynolds(rows: list[JsonObject], number: str) -> Figure:
    lifts = any(abs(row["cl"]) > 1e-6 * row["cd"] for row in rows)
    panels = ("cd", "cl", "cm") if lifts else ("cd",)
    size = 4.2 * len(panels) + 2, 4.4
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False)
    line = sorted(rows, key=lambda row: row[number])
    for axis, y in zip(axes[0], panels, strict=True):
        _draw(axis, line, number, y, color=OPTIMUM)
        axis.set_xscale("log")
        _plain_ticks(axis.xaxis)
        if y == "cd":
            axis.set_yscale("log")
            _plain_ticks(axis.yaxis)
        else:
            axis.axhline(0, color=INK, lw=0.6)
    return figure


def _draw(axis: Axes, rows: list[JsonObject], x: str, y: str, **look: object) -> None:
    """Draw one quantity over another, with the bounds of the errors where they are known."""
    points = ([row[name] for row in rows] for name in (x, y))
    bounds = {f"{side}err": [_bound(r, name) for r in rows] for side, name in (("x", x), ("y", y))}
    axis.errorbar(*points, **bounds, marker="o", ms=4, lw=1.8, elinewidth=1, capsize=2.5, **look)
    axis.set(xlabel=LABELS[x], ylabel=LABELS[y])


def _bound(row: JsonObject, name: str) -> float:
    """Return the bound of the error of a load; NaN, which draws no bar, of what has none."""
    bound = row.get(ERRORS[name]) if name in ERRORS else None
    if bound is None:
        return np.nan
    return bound * row["cd"] if name == "cd" else bound


def _plain_ticks(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers at 1, 2 and 5 times powers of ten."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())
