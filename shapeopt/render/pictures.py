"""Pictures of 2-D flows with pyvista: flows side by side, shape histories, marches in time."""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from jaxtyping import Float

from shapeopt.export.solid import polygon
from shapeopt.render.mesh import flow_mesh
from surrogate.arrays import AnyArray
from surrogate.body.drawing import drawn_contour
from surrogate.body.family import Family
from surrogate.files import whole_file
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.output.meshes import outline, pv
from surrogate.flow.output.palette import BODY, INK, QUIET
from surrogate.flow.solution import Solution

VIEW = (-1.6, 4.4, -1.35, 1.35)  # x and y range shown, in D
PIXELS = 150  # per D
STRIP = 0.5  # white strip above a field for its caption, in D
GAP = 0.06  # white margin around a field, in D
TITLE = 58  # characters of a title at its usual size; longer ones are drawn smaller
BAR = 0.5  # height of the strip with the colour bar, in D
GHOST = "#9aa0a6"
COLOURS = "RdBu_r"
NEAR = 0.05  # D around a body where eddies are not looked for
SHALLOW = 2e-3  # U D of the stream function, of an eddy that is not drawn


class Panel(NamedTuple):
    """One picture of a sheet: a solved flow with a title and a note above it."""

    solution: Solution
    title: str
    note: str = ""


def render_flows(rows: list[list[Panel]], path: str | Path) -> Path:
    """Draw flows as a PNG: vorticity in one colour scale, streamlines and the body.

    The colour scale is linear in the square root of vorticity, so that weak vorticity is visible.
    Returns the path.
    """
    meshes = [[_solved_mesh(panel) for panel in row] for row in rows]
    limit = max(np.abs(mesh["vorticity"]).max() for row in meshes for mesh in row)
    limit = max(float(np.ceil(limit)), 1.0)
    columns = max(map(len, rows))
    width, height = VIEW[1] - VIEW[0] + 2 * GAP, VIEW[3] - VIEW[2] + STRIP + 2 * GAP
    plotter = pv.Plotter(
        off_screen=True,
        shape=(len(rows) + 1, columns),
        row_weights=[height] * len(rows) + [BAR],
        groups=[(len(rows), slice(None))],
        window_size=(
            round(PIXELS * width * columns),
            round(PIXELS * (height * len(rows) + BAR)),
        ),
        border=False,
    )
    plotter.set_background("white", all_renderers=True)
    for i, row in enumerate(rows):
        for j, panel in enumerate(row):
            plotter.subplot(i, j)
            _draw_flow(plotter, panel, meshes[i][j], limit)
    plotter.subplot(len(rows), 0)
    _draw_bar(plotter, limit, width * columns)
    with whole_file(path) as part:
        plotter.screenshot(str(part))
    plotter.close()
    return Path(path)


def render_evolution(
    family: Family,
    path_of_bodies: Float[AnyArray, "steps parameters"],
    captions: list[str],
    path: str | Path,
) -> Path:
    """Draw a GIF of the body along the optimiser's path, with the cylinder, and return its path.

    Args:
      family: of the bodies.
      path_of_bodies: their parameters, one frame each.
      captions: one for each frame.
      path: of the GIF.
    """
    bodies = [np.asarray(drawn_contour(family.body_class, body, 240)) for body in path_of_bodies]
    cylinder = np.asarray(family.outline(family.ellipse(1.0), 240))
    x, y = np.abs(np.concatenate([*bodies, cylinder])).max(axis=0) + 0.12
    view = (-x, x, -y, y + 0.18)
    plotter = pv.Plotter(off_screen=True, window_size=_even(view, 720))
    with whole_file(path) as part:
        plotter.open_gif(str(part), fps=4, loop=0)
        last = len(bodies) - 1
        for k, (markers, caption) in enumerate(zip(bodies, captions, strict=True)):
            plotter.clear()
            plotter.add_mesh(polygon(markers), color="#31688e", lighting=False)
            plotter.add_mesh(outline(cylinder, 0.02), color=GHOST, line_width=2, lighting=False)
            write_caption(plotter, caption, (0.02, 0.91), 12)
            _look_at(plotter, view)
            for _ in range(6 if k in (0, last) else 1):
                plotter.write_frame()
        plotter.close()
    return Path(path)


def render_march(
    lattice: Lattice,
    markers: Float[AnyArray, "nodes 2"],
    frames: list[Float[np.ndarray, "2 nx ny"]],
    captions: list[str],
    path: str | Path,
) -> Path:
    """Draw a GIF of the vorticity of a march in time, in the middle third of its height.

    Args:
      lattice: of the domain, unfolded.
      markers: of the body.
      frames: velocities on the faces.
      captions: one for each frame.
      path: of the GIF, which is returned.
    """
    (left, right), (low, high) = lattice.grid.domain
    edge = 2 * lattice.step[0]
    view = (max(left + edge, -3.0), right - edge, low / 3, high / 3)
    plotter = pv.Plotter(off_screen=True, window_size=_even(view, 960))
    with whole_file(path) as part:
        plotter.open_gif(str(part), fps=12, loop=0)
        for velocity, caption in zip(frames, captions, strict=True):
            plotter.clear()
            mesh = flow_mesh(lattice, np.asarray(velocity))
            _colour(plotter, mesh, mesh["vorticity"], 3)
            plotter.add_mesh(polygon(markers, 0.02), color=INK, lighting=False)
            write_caption(plotter, caption, (0.01, 0.915), 12)
            _look_at(plotter, view)
            plotter.write_frame()
        plotter.close()
    return Path(path)


def _draw_flow(plotter: pv.Plotter, panel: Panel, mesh: pv.ImageData, limit: float) -> None:
    field = mesh.clip_box((*VIEW, -1, 1), invert=False)
    _colour(plotter, field, _squashed(field["vorticity"]), _squashed(limit))
    for lines in _streamlines(mesh, panel.solution.markers):
        plotter.add_mesh(lines, color=INK, line_width=1.2, opacity=0.5, lighting=False)
    plotter.add_mesh(polygon(panel.solution.markers, 0.02), color=BODY, lighting=False)
    plotter.add_mesh(outline(panel.solution.markers, 0.03), color=INK, line_width=3, lighting=False)
    write_caption(plotter, panel.title, (0.012, 0.925), title_size(15, panel.title))
    write_caption(plotter, panel.note, (0.012, 0.868), 11, QUIET)
    left, right, low, high = VIEW
    _look_at(plotter, (left - GAP, right + GAP, low - GAP, high + GAP + STRIP))


def _draw_bar(plotter: pv.Plotter, limit: float, width: float) -> None:
    """Draw a colour bar with its numbers below and its name to the left."""
    samples, half = 257, 1.6
    bar = pv.ImageData(
        dimensions=(samples, 2, 1),
        spacing=(2 * half / (samples - 1), 0.13, 1),
        origin=(-half, 0, 0),
    )
    _colour(plotter, bar, np.tile(np.linspace(-1, 1, samples), 2), 1.0)
    _look_at(plotter, (-width / 2, width / 2, -0.3, BAR - 0.3))
    for share in (-1, -0.5, 0, 0.5, 1):
        value = np.sign(share) * share**2 * limit
        write_caption(plotter, f"{value:g}", (0.5 + share * half / width, 0.1), 11, place="center")
    write_caption(plotter, "vorticity, U / D", (0.49 - half / width, 0.6), 11, QUIET, place="right")


def _solved_mesh(panel: Panel) -> pv.ImageData:
    solution = panel.solution
    return flow_mesh(solution.domain.lattice.unfolded, solution.velocity, refined=3)


def _streamlines(mesh: pv.ImageData, markers: AnyArray) -> list[pv.DataSet]:
    """Return streamlines every 0.09 U D from the body's own, and four in each eddy of the wake."""
    field = mesh.clip_box((*VIEW, -1, 1), invert=False)
    of_body, centres = _stream_levels(mesh, markers)
    found = [field.contour(of_body + 0.09 * (np.arange(-60, 60) + 0.5), scalars="stream function")]
    for depth in centres:
        levels = np.sort(of_body + depth * np.array([0.1, 0.4, 0.7, 0.95]))
        for line in field.contour(levels, scalars="stream function").split_bodies():
            if (
                line.bounds[0] > field.bounds[0] + NEAR
            ):  # others of the same level come from upstream
                found.append(line)
    for lines in found:
        lines.points[:, 2] = 0.01
    return [lines for lines in found if lines.n_points]


def _stream_levels(mesh: pv.ImageData, markers: AnyArray) -> tuple[float, list[float]]:
    """Return the stream function on the body, and its values over that in the eddies' centres.

    At an eddy's centre it has its least or greatest value where the flow is reversed.
    """
    nx, ny, _ = mesh.dimensions
    x, y = (
        origin + step * np.arange(count)
        for origin, step, count in zip(mesh.origin, mesh.spacing, (nx, ny), strict=False)
    )
    stream = np.asarray(mesh["stream function"]).reshape(ny, nx)
    reversed_flow = np.gradient(stream, y, axis=0) < 0
    seen = np.ix_((y > VIEW[2]) & (y < VIEW[3]), (x > VIEW[0]) & (x < VIEW[1]))
    stream, reversed_flow = stream[seen], reversed_flow[seen]
    x, y = (axis[seen] for axis in np.meshgrid(x, y))
    body = shapely.Polygon(markers)
    of_body = float(stream[shapely.contains_xy(body, x, y)].mean())
    wake = reversed_flow & (x > 0) & ~shapely.contains_xy(body.buffer(NEAR), x, y)
    depths = stream[wake] - of_body
    ends = (depths.min(initial=0.0), depths.max(initial=0.0))
    return of_body, [float(depth) for depth in ends if abs(depth) > SHALLOW]


def _squashed(vorticity: np.ndarray | float) -> np.ndarray | float:
    """Return the square root of the absolute value, with the sign."""
    return np.sign(vorticity) * np.sqrt(np.abs(vorticity))


def _colour(plotter: pv.Plotter, mesh: pv.DataSet, values: np.ndarray, limit: float) -> None:
    plotter.add_mesh(
        mesh,
        scalars=values,
        cmap=COLOURS,
        clim=(-limit, limit),
        lighting=False,
        show_scalar_bar=False,
    )


def title_size(usual: int, title: str) -> int:
    """Return the size of a title's font: the usual one, or a smaller one where it is long."""
    return round(usual * min(1.0, TITLE / len(title)))


def write_caption(
    plotter: pv.Plotter,
    text: str,
    at: tuple[float, float],
    size: int,
    colour: str = INK,
    place: str = "left",
) -> None:
    """Draw a line of text in a window, with minus signs in place of hyphens before numbers.

    Args:
      plotter: of the window.
      text: the line.
      at: position of the text, from 0 to 1 across and upwards.
      size: of the font.
      colour: of the text.
      place: horizontal justification: "left", "center" or "right".
    """
    text = re.sub(r"(?<!\w)-(?=[\d.])", "\N{MINUS SIGN}", text)
    actor = plotter.add_text(text, position=at, viewport=True, font_size=size, color=colour)
    actor.prop.justification_horizontal = place


def _even(view: tuple[float, ...], width: int) -> tuple[int, int]:
    """Return the window size in pixels for a view, even numbers as video players need."""
    left, right, low, high = view
    return width, 2 * round(width * (high - low) / (right - left) / 2)


def _look_at(plotter: pv.Plotter, view: tuple[float, ...]) -> None:
    left, right, low, high = view
    plotter.set_background("white")
    plotter.view_xy()
    plotter.enable_parallel_projection()
    centre = ((left + right) / 2, (low + high) / 2, 0)
    plotter.camera.focal_point = centre
    plotter.camera.position = (*centre[:2], 10)
    plotter.camera.parallel_scale = (high - low) / 2
