"""matplotlib without a display: one style, one way to save a figure."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from shapeopt.render.signature import whole_picture

INK, QUIET, START, OPTIMUM = "#1a1a1a", "#5f6368", "#8a8f98", "#0b5394"
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


def save_figure(figure: plt.Figure, path: str | Path, dpi: int = 140) -> Path:
    """Write a figure as PNG, whole or not at all, and close it."""
    with whole_picture(path) as part:
        figure.savefig(part, dpi=dpi)
    plt.close(figure)
    return Path(path)
