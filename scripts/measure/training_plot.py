"""Drag error against work and against time, one line a method."""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from surrogate.files import whole_file


def plot_training(rows: list[dict[str, Any]], path: Path) -> Path:
    """Draw mean held-out drag error of every row's history; a colour a method.

    Work of every seed; time of the first alone, lest the machine's other work be drawn as well.
    """
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained", sharey=True)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    for row in rows:
        first = row["seed"] == rows[0]["seed"]
        look = {"color": f"C{methods.index(row['method']) % 10}", "ms": 3}
        look |= {"label": row["method"] if first else None}
        style = "o--" if row["seconds"] is None else "-"
        for axis, column in zip(axes, (2, 1), strict=True) if first else [(axes[0], 2)]:
            points = [(p[column], 100 * p[3]) for p in row["history"] if p[column] > 0]
            if points:
                axis.plot(*zip(*points, strict=True), style, **look)
    axes[0].set(xlabel="applications of G", ylabel="mean drag error, %")
    axes[1].set(xlabel="seconds of training (first seed)")
    for axis in axes:
        axis.set(xscale="log", yscale="log")
    axes[0].legend(frameon=False, fontsize=8)
    with whole_file(path) as part:
        figure.savefig(part, dpi=140)
    plt.close(figure)
    return path
