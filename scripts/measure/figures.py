"""Pictures of studies: coloured maps, and lines in logarithmic axes."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from study import Result, Row, values

from shapeopt.render.figures import STYLE, save_figure

Lines = Sequence[tuple[str | None, Sequence[tuple[float, float]], Mapping[str, Any]]]


def lines(
    x: str, y: str, by: str | None, labels: tuple[str, str], panel: str = "", key: str = "rows"
) -> Callable[[Result, Path], None]:
    """Return a function that draws column ``y`` over ``x`` of a study's rows, in logarithmic axes.

    Args:
      x: column.
      y: column; rows without a value are left out.
      by: column, each of whose values has a line; None for one line.
      labels: of the axes x and y.
      panel: column, each of whose values has axes of its own; none by default.
      key: of the rows in the study's result.
    """

    def draw(result: Result, path: Path) -> None:
        panels: dict[str, dict[str, Any]] = {}
        for row in result[key]:
            if row.get(y) is not None:
                part = f"{labels[0]}; {panel} {row[panel]}" if panel else labels[0]
                points = panels.setdefault(part, {}).setdefault(row.get(by), [])
                points.append((row[x], row[y]))
        drawn = [(part, [(*line, {}) for line in found.items()]) for part, found in panels.items()]
        draw_lines(drawn, labels[1], path)

    return draw


def draw_lines(panels: Sequence[tuple[str, Lines]], ylabel: str, path: Path) -> None:
    """Draw logarithmic axes side by side, each with its label and lines, and save the picture.

    Each line is (label, points, settings of matplotlib).
    """
    with rc_context(STYLE):
        size = {"figsize": (4.6 * len(panels) + 2.4, 4.4), "layout": "constrained"}
        figure = Figure(**size)
        axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)
    for axis, (xlabel, drawn) in zip(axes[0], panels, strict=True):
        for label, points, look in drawn:
            axis.loglog(*zip(*points, strict=True), label=label, **{"marker": "o", "ms": 3} | look)
        axis.set(xlabel=xlabel)
        axis.xaxis.set_minor_formatter("")
    axes[0, 0].set(ylabel=ylabel)
    axes[0, 0].yaxis.set_minor_formatter("")
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
    """Draw a map for each ``panel`` of the rows, coloured by the ``outcome`` of each row.

    Args:
      rows: with "panel", "row", "column" and "outcome".
      cell: returns the text in the cell of a row.
      colours: by outcome.
      path: of the picture.
      abreast: number of maps side by side.
    """
    panels = values(rows, "panel")
    deep = math.ceil(len(panels) / abreast)
    figure = Figure(figsize=(13, 0.5 + 6 * deep / abreast), layout="constrained")
    axes = figure.subplots(deep, abreast, squeeze=False)
    for axis in axes.flat[len(panels) :]:
        axis.axis("off")
    for axis, panel in zip(axes.flat, panels, strict=False):
        mine = [row for row in rows if row["panel"] == panel]
        ys, xs = values(mine, "row"), values(mine, "column")
        for row in mine:
            x, y = xs.index(row["column"]), ys.index(row["row"])
            look = {"facecolor": colours[row["outcome"]], "edgecolor": "white"}
            axis.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, **look))
            axis.text(x, y, cell(row), ha="center", va="center", fontsize=7)
        axis.set(xlim=(-0.5, len(xs) - 0.5), ylim=(len(ys) - 0.5, -0.5), title=panel)
        axis.set_xticks(range(len(xs)), xs, fontsize=8)
        axis.set_yticks(range(len(ys)), ys, fontsize=8)
    handles = [Rectangle((0, 0), 1, 1, color=colour) for colour in colours.values()]
    below = {"loc": "outside lower center", "ncols": len(colours), "frameon": False}
    figure.legend(handles, list(colours), **below)
    save_figure(figure, path, dpi=110)
