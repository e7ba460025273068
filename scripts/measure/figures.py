"""Pictures of studies: coloured maps, and lines in logarithmic axes."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from study import Row, values

from shapeopt.render.figures import STYLE, plt, save_figure


class Line(NamedTuple):
    """Points (x, y) with a label and matplotlib's settings."""

    points: Sequence[tuple[float, float]]
    label: str | None
    look: Mapping[str, Any] = {"marker": "o", "ms": 3}


class Panel(NamedTuple):
    """Lines in one pair of axes."""

    lines: Sequence[Line]
    xlabel: str
    title: str = ""


def draw_lines(panels: Sequence[Panel], ylabel: str, path: Path) -> None:
    """Panels side by side with common vertical axes, all logarithmic, and one legend."""
    with plt.rc_context(STYLE):
        size = (4.6 * len(panels) + 2.4, 4.4)
        figure, axes = plt.subplots(
            1, len(panels), figsize=size, layout="constrained", sharey=True, squeeze=False
        )
    for axis, panel in zip(axes[0], panels, strict=True):
        for points, label, look in panel.lines:
            axis.loglog(*zip(*points, strict=True), label=label, **look)
        axis.set(xlabel=panel.xlabel, title=panel.title)
        axis.xaxis.set_minor_formatter("")
    axes[0, 0].set(ylabel=ylabel)
    axes[0, 0].yaxis.set_minor_formatter("")
    axes[0, 0].yaxis.set_major_formatter("{x:g}")
    handles = axes[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside right center", frameon=False)
    save_figure(figure, path)


def draw_maps(
    rows: Sequence[Row],
    cell: Callable[[Row], str],
    colours: Mapping[str, str],
    path: Path,
    abreast: int = 2,
) -> None:
    """One map per ``panel``, ``abreast`` in a line, coloured by the ``outcome`` of its rows."""
    panels = values(rows, "panel")
    deep = math.ceil(len(panels) / abreast)
    size = {"figsize": (13, 0.5 + 6 * deep / abreast), "squeeze": False, "layout": "constrained"}
    figure, axes = plt.subplots(deep, abreast, **size)
    for axis in axes.flat[len(panels) :]:
        axis.axis("off")
    for axis, panel in zip(axes.flat, panels, strict=False):
        mine = [row for row in rows if row["panel"] == panel]
        ys, xs = values(mine, "row"), values(mine, "column")
        for row in mine:
            x, y = xs.index(row["column"]), ys.index(row["row"])
            look = {"facecolor": colours[row["outcome"]], "edgecolor": "white"}
            axis.add_patch(plt.Rectangle((x - 0.5, y - 0.5), 1, 1, **look))
            axis.text(x, y, cell(row), ha="center", va="center", fontsize=7)
        axis.set(xlim=(-0.5, len(xs) - 0.5), ylim=(len(ys) - 0.5, -0.5), title=panel)
        axis.set_xticks(range(len(xs)), xs, fontsize=8)
        axis.set_yticks(range(len(ys)), ys, fontsize=8)
    handles = [plt.Rectangle((0, 0), 1, 1, color=colour) for colour in colours.values()]
    below = {"loc": "outside lower center", "ncols": len(colours), "frameon": False}
    figure.legend(handles, list(colours), **below)
    save_figure(figure, path, dpi=110)
