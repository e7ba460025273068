"""Least Cd of bodies over their Cl, with every body drawn, and the best glide ratio."""

from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.transforms import ScaledTranslation

from shapeopt.render.figures import OPTIMUM, STYLE, save_figure
from surrogate.body.drawing import drawn_contour
from surrogate.body.family import Family
from surrogate.files import JsonObject
from surrogate.flow.output.palette import INK, QUIET

GLIDE = "#b35900"
SIZE = 10.0, 6.2  # of the figure in inches
WIDTH = 9.2  # inches between the ends of its axis
ABOVE, BELOW = 0.45, -0.75  # inches from a point to the centroid of its body
LARGEST, LEAST = 0.55, 0.2  # inches of one D in the figure


def plot_over_lift(
    family: Family,
    rows: list[JsonObject],
    best: JsonObject | None,
    path: str | Path,
    by_chord: bool = False,
) -> Path:
    """Plot Cd over Cl of bodies of least drag, each body at its incidence above its point.

    The tangent from the origin, where Cl / Cd is greatest, is that of the best glide ratio; its
    body is drawn below. Returns the path of the picture.

    Args:
      family: of the bodies.
      rows: the bodies of least drag, with "parameters", "cd" and "cl".
      best: the body of best glide, with "glide" too; None if it is not known.
      path: of the picture.
      by_chord: whether Re and coefficients are based on the chord; bodies are then of one chord.
    """
    number = rows[0]["chord_reynolds" if by_chord else "reynolds"]
    reynolds = f"{'chord ' * by_chord}Re {number:.4g}"
    drawn = rows if best is None else [*rows, best]
    lifts = [0.0, *(row["cl"] for row in drawn)]
    span = max(lifts) - min(lifts) or 1.0
    left, right = min(lifts) - 0.08 * span, max(lifts) + 0.1 * span
    with rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout="constrained")
        axis = figure.subplots()
        points = sorted((row["cl"], row["cd"]) for row in rows)
        axis.plot(*np.transpose(points), color=OPTIMUM, lw=2, marker="o", ms=5)
        longest = max(row["chord"] for row in drawn) if by_chord else None
        bodies = [section_contour(family, row, longest) for row in rows]
        scale = _draw_bodies(axis, bodies, rows, WIDTH / (right - left))
        if best is not None:
            _draw_best(axis, scale * section_contour(family, best, longest), best)
            axis.legend(loc="lower right")
        axis.set(
            xlim=(left, right),
            ylim=(0, 1.35 * max(row["cd"] for row in drawn)),
            xlabel="$C_l$, over c" if by_chord else "$C_l$",
            ylabel="$C_d$, over c" if by_chord else "$C_d$",
            title=f"least $C_d$ for $C_l$, {reynolds}",
        )
        axis.axvline(0, color=INK, lw=0.6, zorder=0)
        return save_figure(figure, path)


def _draw_bodies(
    axis: Axes,
    bodies: list[Float[np.ndarray, "nodes 2"]],
    rows: list[JsonObject],
    inches: float,
) -> float:
    """Draw the bodies side by side, as large as there is room; return the inches of one D.

    Bodies that would lie on the one before are left out, as where a bound on the lift is slack.

    Args:
      axis: of the figure.
      bodies: their contours.
      rows: the bodies.
      inches: of one unit of Cl in the figure.
    """
    length = max(float(np.ptp(body[:, 0])) for body in bodies)
    kept: list[int] = []
    for k in np.argsort([row["cl"] for row in rows]):
        gap = np.inf if not kept else inches * (rows[k]["cl"] - rows[kept[-1]]["cl"])
        if gap > LEAST * length:
            kept.append(int(k))
    gaps = inches * np.diff([rows[k]["cl"] for k in kept])
    scale = float(np.clip(0.9 * min(gaps, default=np.inf) / length, 0.9 * LEAST, LARGEST))
    for k in kept:
        _draw_at(axis, np.add(scale * bodies[k], (0, ABOVE)), rows[k], OPTIMUM)
    return scale


def _draw_best(axis: Axes, body: Float[np.ndarray, "nodes 2"], best: JsonObject) -> None:
    """Draw the body of best glide, given in inches, and the line from the origin to its point."""
    lift, drag = best["cl"], best["cd"]
    label = f"best glide: $C_l / C_d$ = {best['glide']:.3f}"
    line = {"lw": 1.4, "ls": (0, (5, 3)), "label": label}
    axis.plot([0, 1.08 * lift], [0, 1.08 * drag], color=GLIDE, **line)
    axis.plot(lift, drag, color=GLIDE, marker="D", ms=8, mfc="none", mew=2, ls="")
    _draw_at(axis, np.add(body, (0, BELOW)), best, GLIDE)
    axis.annotate(
        f"$C_l$ {lift:.3f}, $C_d$ {drag:.3f}", (lift, drag), (0, 72 * BELOW - 34),
        textcoords="offset points", ha="center", va="top", fontsize=9, color=QUIET,
    )  # fmt: skip


def _draw_at(axis: Axes, body: Float[np.ndarray, "nodes 2"], row: JsonObject, colour: str) -> None:
    """Fill a body that is given in inches from the point of its row."""
    to_point = ScaledTranslation(row["cl"], row["cd"], axis.transData)
    place = axis.figure.dpi_scale_trans + to_point
    axis.add_artist(Polygon(body, color=colour, lw=0, alpha=0.85, transform=place, clip_on=False))


def section_contour(
    family: Family, row: JsonObject, chord: float | None
) -> Float[np.ndarray, "nodes 2"]:
    """Return the contour of a body as it lies in the stream, in D; scaled to a chord if given."""
    body = family.parameters(row["parameters"])
    scale = 1.0 if chord is None else chord / row["chord"]
    return scale * np.asarray(drawn_contour(family.body_class, body, 300))
