"""Pictures of flows: vorticity and pressure with streamlines around the body."""

from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from surrogate.files import whole_file
from surrogate.flow.fields import Fields
from surrogate.flow.output.palette import BODY, INK, QUIET

VIEW = (-1.6, 4.4, -1.4, 1.4)  # x and y range shown, in D
MARGIN = 0.9  # D ahead of, behind and beside larger bodies
DPI = 130
MINUS = "\N{MINUS SIGN}"
ROWS = 25  # streamlines that start upstream


class Picture(NamedTuple):
    """A flow to be drawn: its title, its fields and its body's contour, in 3-D in y = 0."""

    title: str
    fields: Fields
    contour: Float[np.ndarray, "nodes 2"]


class _Plane(NamedTuple):
    """A plane of a flow: coordinates, velocity in it (NaN in the body), vorticity across it, Cp."""

    x: np.ndarray
    y: np.ndarray
    u: np.ndarray
    v: np.ndarray
    vorticity: np.ndarray
    cp: np.ndarray


def draw_flows(pictures: list[Picture], path: str | Path) -> Path:
    """Draw flows as a PNG, one row each, vorticity and Cp with streamlines, and return its path.

    3-D flows are drawn in their mirror plane y = 0, which streamlines do not leave. Colours are
    linear in the square root of vorticity, so that weak vorticity is visible.
    """
    views = [_view(picture) for picture in pictures]
    tall = [(view[3] - view[2]) / (view[1] - view[0]) for view in views]
    figure = Figure(figsize=(14, 6.1 * sum(tall) + 0.95 * len(tall)), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(pictures), 2, squeeze=False, height_ratios=tall)
    for picture, view, (left, right) in zip(pictures, views, panels, strict=True):
        plane = _plane(picture.fields)
        spin = np.sign(plane.vorticity) * np.sqrt(np.abs(plane.vorticity))
        seen = _seen(plane, view)
        limit = np.sqrt(max(np.nanpercentile(np.abs(plane.vorticity[seen]), 99.5), 1e-6))
        top = max(np.nanpercentile(np.abs(plane.cp[seen]), 99.5), 1e-6)
        image = _panel(left, picture, plane, view, spin, limit)
        beyond = {"extend": "both", "extendfrac": 0.03}  # as a few values are
        bar = figure.colorbar(image, ax=left, pad=0.01, shrink=0.7, **beyond)
        ends = limit * np.linspace(-1, 1, 5)
        values = (f"{np.sign(e) * e * e:.3g}" for e in ends)
        bar.set_ticks(ends, labels=[value.replace("-", MINUS) for value in values])
        bar.set_label("vorticity, U / D (square-root scale)")
        image = _panel(right, picture, plane, view, plane.cp, top)
        figure.colorbar(image, ax=right, pad=0.01, shrink=0.7, **beyond).set_label("pressure, Cp")
        left.set_title(picture.title, loc="left", fontsize=12, fontweight="bold", color=INK)
        left.set_ylabel("y / D" if len(picture.fields.axes) == 2 else "z / D")
    with whole_file(path) as part:
        figure.savefig(part, dpi=DPI)
    return Path(path)


def _panel(
    axis: Axes, picture: Picture, plane: _Plane, view: tuple, values: np.ndarray, limit: float
) -> mpl.cm.ScalarMappable:
    """Draw one field in colour with streamlines and the body; return the coloured image."""
    image = axis.pcolormesh(
        plane.x, plane.y, values.T, cmap="RdBu_r", vmin=-limit, vmax=limit,
        shading="gouraud", rasterized=True,
    )  # fmt: skip
    starts = np.linspace(view[2] + 0.02, view[3] - 0.02, ROWS)
    start = max(view[0], plane.x[0]) + 0.05
    seeds = np.column_stack([np.full(ROWS, start), np.clip(starts, plane.y[1], plane.y[-2])])
    keep = (plane.x >= view[0] - 0.3) & (plane.x <= view[1] + 0.3)
    axis.streamplot(
        plane.x[keep], plane.y, plane.u[keep].T, plane.v[keep].T, start_points=seeds,
        color=INK, linewidth=0.7, arrowsize=0.7, density=6, broken_streamlines=False,
        integration_direction="forward",
    )  # fmt: skip
    _draw_eddies(axis, plane, picture.contour, view)
    axis.fill(*picture.contour.T, facecolor=BODY, edgecolor=INK, lw=1.6, zorder=5)
    axis.set(xlim=view[:2], ylim=view[2:], aspect="equal", xlabel="x / D")
    axis.tick_params(colors=QUIET)
    return image


def _draw_eddies(axis: Axes, plane: _Plane, contour: np.ndarray, view: tuple) -> None:
    """Draw streamlines from within the regions of reversed flow behind the body.

    The sense of rotation tells one eddy from another: that on the upper side turns clockwise. In a
    wake that is not symmetric neither lies on a side of y = 0.
    """
    x, y = np.meshgrid(plane.x, plane.y, indexing="ij")
    reversed_flow = (plane.u < -2e-3) & (x > contour[:, 0].mean()) & (x < view[1])
    reversed_flow &= (y > view[2]) & (y < view[3])
    if not np.any(reversed_flow):
        return
    for sense in (-1, 1):
        places = np.argwhere(reversed_flow & (sense * plane.vorticity > 0))
        if len(places) < 4:
            continue
        middle = places[len(places) // 2, 0]  # argwhere sorts by columns
        column = places[places[:, 0] == middle][::-sense]  # mirror images
        chosen = column[np.unique(np.linspace(0, len(column) - 1, 3).astype(int))]
        seeds = np.column_stack([plane.x[chosen[:, 0]], plane.y[chosen[:, 1]]])
        keep = (plane.x >= view[0]) & (plane.x <= view[1])
        axis.streamplot(
            plane.x[keep], plane.y, plane.u[keep].T, plane.v[keep].T, start_points=seeds,
            color=INK, linewidth=0.7, arrowsize=0.7, density=6, maxlength=1.5,
            broken_streamlines=False,
        )  # fmt: skip


def _view(picture: Picture) -> tuple[float, float, float, float]:
    """Return the range shown: the usual one, larger for larger bodies, within the fields."""
    low, high = picture.contour.min(axis=0), picture.contour.max(axis=0)
    x, y = picture.fields.axes[0], picture.fields.axes[-1]
    return (
        max(min(VIEW[0], low[0] - MARGIN), x[0]),
        min(max(VIEW[1], high[0] + 2 * MARGIN), x[-1]),
        max(min(VIEW[2], low[1] - MARGIN), y[0]),
        min(max(VIEW[3], high[1] + MARGIN), y[-1]),
    )


def _seen(plane: _Plane, view: tuple) -> np.ndarray:
    inside = np.logical_and.outer(
        (plane.x > view[0]) & (plane.x < view[1]), (plane.y > view[2]) & (plane.y < view[3])
    )
    return inside & np.isfinite(plane.u)


def _plane(fields: Fields) -> _Plane:
    """Return the plane of a 2-D flow, or y = 0 of a 3-D one, between its two middle rows."""
    arrays = [fields.velocity[0], fields.velocity[-1], fields.p, fields.vorticity]
    body = fields.inside
    if len(fields.axes) == 3:
        arrays[3] = -fields.vorticity[1]  # anticlockwise as seen with z upwards
        middle = len(fields.axes[1]) // 2
        arrays = [part[:, middle - 1 : middle + 1].mean(axis=1) for part in arrays]
        body = body[:, middle]
    u, v, p, spin = (np.asarray(part, float) for part in arrays)
    blank = np.where(body, np.nan, 0.0)
    return _Plane(fields.axes[0], fields.axes[-1], u + blank, v + blank, spin, 2 * p)
