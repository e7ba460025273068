"""Plots of runs: surface stresses, and optimal bodies over the Reynolds number."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shapeopt.records import is_by_chord, reynolds_text, run_body, run_reynolds, run_scene
from shapeopt.render.figures import (
    FROM_ABOVE,
    OPTIMUM,
    START,
    STYLE,
    draw_body,
    save_figure,
    width_over_height,
)
from shapeopt.render.sheets import reference_name, standing
from surrogate.body.drawing import drawn_contour
from surrogate.files import JsonObject
from surrogate.flow.output.palette import INK
from surrogate.flow.surface.surface import Surface

LOOKS = {"color": START, "ls": (0, (5, 2))}, {"color": OPTIMUM}  # reference body, optimum


def plot_surfaces(runs: list[tuple[JsonObject, Sequence[Surface]]], path: str | Path) -> Path:
    """Plot Cp and Cf over x / c of the reference body and the optimum, one row for each run.

    Of symmetric bodies only the upper side is drawn. Returns the path of the PNG.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(11, 3.9 * len(runs)), layout="constrained")
        axes = figure.subplots(len(runs), 2, squeeze=False)
        for (record, surfaces), (pressure, friction) in zip(runs, axes, strict=True):
            names = reference_name(record), "optimum"
            for surface, name, look in zip(surfaces, names, LOOKS, strict=True):
                lifting = run_scene(record).family.has_lift
                side = slice(None) if lifting else slice(0, len(surface.cp) // 2 + 1)
                for axis, loads in ((pressure, surface.cp), (friction, surface.cf)):
                    axis.plot(surface.station[side], loads[side], lw=2.2, label=name, **look)
            for axis, label, title in (
                (pressure, "$C_p$", "pressure"),
                (friction, "$C_f$", "friction"),
            ):
                axis.axhline(0, color=INK, lw=0.6)
                axis.set(xlim=(0, 1), ylabel=label, title=f"{reynolds_text(record)}, {title}")
            pressure.legend(frameon=False, title=standing(record), alignment="left")
        for axis in axes[-1]:
            axis.set_xlabel("x / c, nose to tail")
        return save_figure(figure, path)


def plot_family(records: list[JsonObject], path: str | Path) -> Path:
    """Draw the optima of several runs to one scale in order of Re, and plot their drag reduction.

    Where a run was for lift, the glide ratios stand for the drag reductions. Bodies wider than
    high are also drawn from above, as a line. The dashed circle has the same area (volume), at
    fixed chord the same chord. Returns the path of the PNG.
    """
    records = sorted(records, key=run_reynolds)
    by_chord = is_by_chord(records[0])
    bodies = [
        np.asarray(drawn_contour(run_scene(r).family.body_class, run_body(r), 400))
        / (r["chord"] if by_chord else 1.0)
        for r in records
    ]
    wide = [width_over_height(record["parameters"]) for record in records]
    sides = [np.abs(body).max(axis=0) * (1, f) for body, f in zip(bodies, wide, strict=True)]
    x, y = np.max(sides, axis=0) * 1.06
    x, y = max(x, 0.53), max(y, 0.53)  # the cylinder is drawn too
    colours = colormaps["viridis"](np.linspace(0.1, 0.72, len(records)))
    width = max(8.0, 2.5 * len(records))
    with rc_context(STYLE):
        figure = Figure(figsize=(width, 5.2), layout="constrained")
        grid = figure.add_gridspec(2, len(records), height_ratios=(1, 1.5))
        family = run_scene(records[0]).family
        circle = np.asarray(family.outline(family.ellipse(1.0), 200))
        for k, (record, body, flatness) in enumerate(zip(records, bodies, wide, strict=True)):
            axis = figure.add_subplot(grid[0, k])
            draw_body(axis, body, flatness, colours[k])
            axis.plot(*np.vstack([circle, circle[:1]]).T, color=START, lw=1, ls=(0, (4, 3)))
            axis.set(xlim=(-x, x), ylim=(-y, y), aspect="equal")
            above = FROM_ABOVE * (flatness > 1)
            axis.set_title(f"{reynolds_text(record)}{above}", loc="center")
            axis.set_axis_off()
        draw = _draw_glide if any(record["about_lift"] for record in records) else _draw_reduction
        draw(figure.add_subplot(grid[1, :]), records, colours)
        return save_figure(figure, path)


def _draw_reduction(axis: Axes, records: list[JsonObject], colours: np.ndarray) -> None:
    """Plot the change of drag against the cylinder's in per cent."""
    change = [100 * (r["cd_verified"] / r["cd_start"] - 1) for r in records]
    _draw_over_reynolds(axis, records, change, [f"{y:+.1f} %" for y in change], colours)
    axis.set(
        ylim=(min(change) - 0.3 * max(5.0, -min(change)), max(0.0, 1.1 * max(change))),
        ylabel=f"drag against the {run_scene(records[0]).family.round_body}, %",
    )


def _draw_glide(axis: Axes, records: list[JsonObject], colours: np.ndarray) -> None:
    """Plot the glide ratio."""
    ratios = [(r.get("cl_verified") or 0.0) / r["cd_verified"] for r in records]
    words = [f"Cl/Cd {ratio:.3f}" for ratio in ratios]
    _draw_over_reynolds(axis, records, ratios, words, colours)
    margin = 0.4 * (max(0.0, *ratios) - min(0.0, *ratios))  # of the words below the points
    ends = min(0.0, min(ratios) - margin), max(0.0, 1.1 * max(ratios))
    axis.set(ylim=ends, ylabel="glide ratio $C_l / C_d$")


def _draw_over_reynolds(
    axis: Axes,
    records: list[JsonObject],
    values: list[float],
    words: list[str],
    colours: np.ndarray,
) -> None:
    """Plot a value of every run over Re, with Cd and words below each."""
    reynolds = list(map(run_reynolds, records))
    by_chord = is_by_chord(records[0])
    axis.plot(reynolds, values, color=START, lw=1.2, zorder=1)
    axis.scatter(reynolds, values, color=colours, s=70, zorder=2)
    for record, x, y, said in zip(records, reynolds, values, words, strict=True):
        text = f"Cd {record['cd_verified']:.3f}\n{said}".replace("-", "\N{MINUS SIGN}")
        axis.annotate(text, (x, y), (0, -14), textcoords="offset points", ha="center", va="top")
    span = max(reynolds) / min(reynolds)
    axis.set(
        xscale="log",
        xlim=(min(reynolds) / max(span, 2) ** 0.12, max(reynolds) * max(span, 2) ** 0.12),
        xlabel="chord Reynolds number $U c / \\nu$" if by_chord else "Reynolds number",
    )
    axis.set_xticks(reynolds, [f"{value:g}" for value in reynolds])
    axis.minorticks_off()
