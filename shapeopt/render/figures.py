"""matplotlib without a display: one style, one way to save a figure."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float

from shapeopt.render.signature import whole_picture

INK, QUIET, START, OPTIMUM = "#1a1a1a", "#5f6368", "#8a8f98", "#0b5394"
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


def draw_body(
    axis: plt.Axes, outline: Float[np.ndarray, "nodes 2"], flatness: float, colour, centre=(0, 0)
) -> None:
    """A body from the side, filled; as a line from above, where it is wider than high."""
    axis.fill(*(outline + centre).T, color=colour, lw=0)
    if flatness > 1:
        above = outline * (1, flatness) + centre
        axis.plot(*np.vstack([above, above[:1]]).T, color=colour, lw=1)


def save_figure(figure: plt.Figure, path: str | Path, dpi: int = 140) -> Path:
    """Write a figure as PNG, whole or not at all, and close it."""
    with whole_picture(path) as part:
        figure.savefig(part, dpi=dpi)
    plt.close(figure)
    return Path(path)
