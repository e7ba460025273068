"""Fields of panels, each of a row and a column: told as tables, drawn in colours."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from shapeopt.render.figures import plt, save_figure
from shapeopt.render.tables import markdown

Field = Mapping[str, Any]  # of these the keys panel, row and column are looked at
Word = Callable[[Field], str]


def map_tables(fields: Sequence[Field], word: Word) -> str:
    """A table a panel."""
    parts = []
    for panel in _values(fields, "panel"):
        mine = [field for field in fields if field["panel"] == panel]
        cells = {(field["row"], field["column"]): word(field) for field in mine}
        columns = _values(mine, "column")
        lines = [
            [row, *(cells.get((row, column), "") for column in columns)]
            for row in _values(mine, "row")
        ]
        parts.append(markdown([panel, *columns], lines))
    return "\n\n".join(parts)


def draw_maps(
    fields: Sequence[Field], word: Word, colours: Mapping[str, str], path: Path, abreast: int = 2
) -> None:
    """A map a panel, so many abreast, coloured by the fields' ``outcome``."""
    panels = _values(fields, "panel")
    deep = math.ceil(len(panels) / abreast)
    size = {"figsize": (13, 0.5 + 6 * deep / abreast), "squeeze": False, "layout": "constrained"}
    figure, axes = plt.subplots(deep, abreast, **size)
    for axis in axes.flat[len(panels) :]:
        axis.axis("off")
    for axis, panel in zip(axes.flat, panels, strict=False):
        mine = [field for field in fields if field["panel"] == panel]
        rows, columns = _values(mine, "row"), _values(mine, "column")
        for field in mine:
            x, y = columns.index(field["column"]), rows.index(field["row"])
            look = {"facecolor": colours[field["outcome"]], "edgecolor": "white"}
            axis.add_patch(plt.Rectangle((x - 0.5, y - 0.5), 1, 1, **look))
            axis.text(x, y, word(field), ha="center", va="center", fontsize=7)
        axis.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5), title=panel)
        axis.set_xticks(range(len(columns)), columns, fontsize=8)
        axis.set_yticks(range(len(rows)), rows, fontsize=8)
    handles = [plt.Rectangle((0, 0), 1, 1, color=colour) for colour in colours.values()]
    below = {"loc": "outside lower center", "ncols": len(colours), "frameon": False}
    figure.legend(handles, list(colours), **below)
    save_figure(figure, path, dpi=110)


def _values(fields, key):
    """What occurs, in order."""
    return list(dict.fromkeys(field[key] for field in fields))
