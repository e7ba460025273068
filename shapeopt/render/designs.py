"""A figure of optimal bodies over Reynolds number and bound on the length."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from shapeopt.render.figures import (
    FROM_ABOVE,
    STYLE,
    draw_body,
    save_figure,
    width_over_height,
)
from surrogate.body.drawing import drawn_contour
from surrogate.body.family import Family
from surrogate.files import JsonObject
from surrogate.flow.output.palette import QUIET

GAP = 0.35  # D, between bodies


def plot_designs(family: Family, rows: list[JsonObject], path: str | Path) -> Path:
    """Draw optimal bodies to one scale: columns by Re, rows by the bound on the length.

    The colour shows the drag that the bound costs. Bodies wider than high are also drawn from
    above, as a line. Returns the path of the PNG.
    """
    columns = sorted({row["reynolds"] for row in rows})
    lengths = list(dict.fromkeys(row["max_length"] for row in rows))
    bodies = [
        np.asarray(drawn_contour(family.body_class, family.parameters(r["parameters"]), 300))
        for r in rows
    ]
    wide = [width_over_height(row["parameters"]) for row in rows]
    sides = [np.ptp(body, axis=0) * (1, f) for body, f in zip(bodies, wide, strict=True)]
    size = np.max(sides, axis=0) + np.array([GAP, 2 * GAP])
    most = max(0.01, *(row["excess"] for row in rows))
    shades = mpl.cm.ScalarMappable(mpl.colors.Normalize(0, 100 * most), "viridis")
    span = size * (len(columns), len(lengths))
    width = min(16.0, max(6.0, 2.2 * len(columns)))
    with rc_context(STYLE):
        figure = Figure(figsize=(width + 1, width * span[1] / span[0] + 1), layout="constrained")
        axis = figure.subplots()
        for row, body, flatness in zip(rows, bodies, wide, strict=True):
            place = columns.index(row["reynolds"]), -lengths.index(row["max_length"])
            centre = size * place
            draw_body(axis, body, flatness, shades.to_rgba(100 * row["excess"]), centre)
            under = centre - (0, flatness * np.ptp(body[:, 1]) / 2 + 0.05)
            text = f"{row['cd']:.3f}"
            axis.annotate(text, under, ha="center", va="top", fontsize=9, color=QUIET)
        axis.set(
            aspect="equal",
            xlim=(-size[0] / 2, span[0] - size[0] / 2),
            ylim=(size[1] / 2 - span[1], size[1] / 2),
            title="least drag: $C_d$ under each body" + FROM_ABOVE * (max(wide) > 1),
        )
        axis.set_xticks(size[0] * np.arange(len(columns)), [f"Re {re:g}" for re in columns])
        words = ["any length" if length is None else f"≤ {length:g} D" for length in lengths]
        axis.set_yticks(-size[1] * np.arange(len(lengths)), words)
        axis.tick_params(length=0)
        axis.spines[["left", "bottom"]].set_visible(False)
        bar = figure.colorbar(shades, ax=axis, shrink=0.6, pad=0.02)
        bar.set_label("drag that the bound costs, %")
        bar.outline.set_visible(False)
        return save_figure(figure, path)
