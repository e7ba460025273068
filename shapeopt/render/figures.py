"""The style of matplotlib figures, and how they are saved."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.typing import ColorType

from surrogate.files import whole_file
from surrogate.flow.output.palette import INK

START, OPTIMUM = "#8a8f98", "#0b5394"
FROM_ABOVE = "; the line: from above"
STYLE = {
    "font.size": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.titlesize": 12,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "legend.frameon": False,
}


def width_over_height(parameters: Mapping[str, float]) -> float:
    """Return by what a body's outline is to be stretched for its view from above.

    It is the flatness; 1 of bodies at incidence, whose view from above is not of this shape.
    """
    return 1.0 if parameters.get("incidence") else parameters.get("flatness", 1.0)


def draw_body(
    axis: Axes,
    outline: Float[np.ndarray, "nodes 2"],
    flatness: float,
    colour: ColorType | np.ndarray,
    centre: Sequence[float] | np.ndarray = (0, 0),
) -> None:
    """Fill a body's outline seen from the side; if flatness > 1, add a line of it from above.

    Args:
      axis: to draw on.
      outline: in D, about the origin.
      flatness: width over height.
      colour: of the fill and the line.
      centre: where the origin of the outline is drawn.
    """
    axis.fill(*(outline + centre).T, color=colour, lw=0)
    if flatness > 1:
        above = outline * (1, flatness) + centre
        axis.plot(*np.vstack([above, above[:1]]).T, color=colour, lw=1)


def save_figure(figure: Figure, path: str | Path, dpi: int = 140) -> Path:
    """Write a figure to a file, and return the path."""
    with whole_file(path) as part:
        figure.savefig(part, dpi=dpi)
    return Path(path)
