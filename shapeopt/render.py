"""Pictures with pyvista, offscreen: flow around bodies side by side, and a body's evolution."""

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body import family_markers
from surrogate.files import whole_file
from surrogate.flow.domain import Domain
from surrogate.flow.drag import Solution
from surrogate.flow.forces import vorticity
from surrogate.flow.lattice import Lattice

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")  # no display needed

import pyvista as pv

VIEW = (-1.6, 4.4, -1.35, 1.35)  # x and y range shown, in D
STREAM = np.array([1.0, 0.0])[:, None, None]
BODY_COLOUR = "#f2efe6"


class Panel(NamedTuple):
    """One picture of a sheet: a solved flow and what to write above it."""

    domain: Domain
    markers: Float[AnyArray, "nodes 2"]
    solution: Solution
    caption: str


def render_flows(rows: list[list[Panel]], path: str | Path) -> Path:
    """A sheet of flows: vorticity in one colour scale for all, streamlines, the body.

    Returns the path of the PNG, which is written whole or not at all.
    """
    shape = (len(rows), max(map(len, rows)))
    plotter = pv.Plotter(
        off_screen=True, shape=shape, window_size=(860 * shape[1], 430 * shape[0]), border=False
    )
    panels = [panel for row in rows for panel in row]
    limit = max(np.percentile(np.abs(_cropped(_solved_mesh(p))["vorticity"]), 98) for p in panels)
    for i, row in enumerate(rows):
        for j, panel in enumerate(row):
            plotter.subplot(i, j)
            _draw(plotter, panel, float(limit), show_bar=(i, j) == (0, 0))
    with whole_file(path) as part:
        plotter.screenshot(str(part))
    plotter.close()
    return Path(path)


def render_evolution(
    path_of_bodies: Float[AnyArray, "steps parameters"],
    captions: list[str],
    path: str | Path,
) -> Path:
    """A GIF of the body along the optimiser's path."""
    plotter = pv.Plotter(off_screen=True, window_size=(640, 400))
    with whole_file(path) as part:
        plotter.open_gif(str(part), fps=4, loop=0)
        last = len(path_of_bodies) - 1
        for k, (parameters, caption) in enumerate(zip(path_of_bodies, captions, strict=True)):
            plotter.clear()
            plotter.add_mesh(
                _polygon(np.asarray(family_markers(parameters, 240))),
                color="#31688e",
                lighting=False,
            )
            plotter.add_text(caption, font_size=10, color="black")
            _look_at(plotter, (-1.4, 1.4, -0.9, 0.9))
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
    """A GIF of the vorticity of a time march."""
    (left, right), (low, high) = lattice.grid.domain
    view = (left, right, low / 2, high / 2)
    aspect = (view[3] - view[2]) / (view[1] - view[0])
    plotter = pv.Plotter(off_screen=True, window_size=(960, round(960 * aspect / 2) * 2))
    with whole_file(path) as part:
        plotter.open_gif(str(part), fps=12, loop=0)
        for velocity, caption in zip(frames, captions, strict=True):
            plotter.clear()
            mesh = _mesh(lattice, np.asarray(velocity))
            plotter.add_mesh(
                mesh,
                scalars="vorticity",
                cmap="RdBu_r",
                clim=(-3, 3),
                lighting=False,
                show_scalar_bar=False,
            )
            plotter.add_mesh(_polygon(markers, 0.02), color="black", lighting=False)
            plotter.add_text(caption, font_size=10, color="black")
            _look_at(plotter, view)
            plotter.write_frame()
        plotter.close()
    return Path(path)


def _draw(plotter, panel, limit, show_bar):
    mesh = _solved_mesh(panel)
    plotter.add_mesh(
        _cropped(mesh),
        scalars="vorticity",
        cmap="RdBu_r",
        clim=(-limit, limit),
        lighting=False,
        show_scalar_bar=show_bar,
        scalar_bar_args={
            "title": "vorticity D / U",
            "position_x": 0.32,
            "position_y": 0.02,
            "width": 0.36,
            "height": 0.12,
            "title_font_size": 16,
            "label_font_size": 14,
            "n_labels": 3,
            "fmt": "%.1f",
            "color": "black",
        },
    )
    plotter.add_mesh(_streamlines(mesh), color="black", line_width=1, opacity=0.45, lighting=False)
    plotter.add_mesh(_polygon(panel.markers, 0.02), color=BODY_COLOUR, lighting=False)
    plotter.add_mesh(_outline(panel.markers, 0.03), color="black", line_width=3)
    plotter.add_text(panel.caption, font_size=11, color="black", position="upper_left")
    _look_at(plotter, VIEW)


def _solved_mesh(panel):
    lattice, velocity = panel.domain.lattice, panel.solution.state.velocity
    return _mesh(lattice.unfolded, np.asarray(lattice.unfold(velocity)) + STREAM)


def _mesh(lattice, velocity):
    """Velocity and vorticity on the corners of the window's cells."""
    u, v = velocity
    (x, _), (_, y) = lattice.faces()
    dx, dy = lattice.step
    nx, ny = lattice.shape
    mesh = pv.ImageData(dimensions=(nx, ny, 1), spacing=(dx, dy, 1), origin=(x[0], y[0], 0))
    corner_u = (u + np.roll(u, -1, axis=1)) / 2
    corner_v = (v + np.roll(v, -1, axis=0)) / 2
    vectors = np.stack([corner_u, corner_v, np.zeros_like(u)], axis=-1)
    mesh["velocity"] = vectors.transpose(1, 0, 2).reshape(-1, 3)
    mesh["vorticity"] = np.asarray(vorticity(lattice, velocity)).T.ravel()
    return mesh


def _cropped(mesh):
    return mesh.clip_box((*VIEW, -1, 1), invert=False)


def _streamlines(mesh):
    seeds = np.zeros((31, 3))
    seeds[:, 0], seeds[:, 1] = VIEW[0], np.linspace(VIEW[2] + 0.04, VIEW[3] - 0.04, 31)
    wake = np.zeros((14, 3))
    wake[:, 0] = np.repeat(np.linspace(0.75, 1.8, 7), 2)
    wake[:, 1] = np.tile([-0.18, 0.18], 7)
    lines = [
        mesh.streamlines_from_source(
            pv.PolyData(points), "velocity", integration_direction=way, max_length=12.0
        )
        for points, way in ((seeds, "forward"), (wake, "both"))
    ]
    lines = pv.merge([line for line in lines if line.n_points])
    lines = lines.clip_box((*VIEW, -1, 1), invert=False)
    lines.points[:, 2] = 0.01
    return lines


def _polygon(markers, height=0.0):
    points = np.column_stack([markers, np.full(len(markers), height)])
    return pv.PolyData(points, faces=[len(points), *range(len(points))]).triangulate()


def _outline(markers, height):
    points = np.column_stack([markers, np.full(len(markers), height)])
    return pv.lines_from_points(points, close=True)


def _look_at(plotter, view):
    left, right, low, high = view
    plotter.set_background("white")
    plotter.view_xy()
    plotter.enable_parallel_projection()
    centre = ((left + right) / 2, (low + high) / 2, 0)
    plotter.camera.focal_point = centre
    plotter.camera.position = (*centre[:2], 10)
    plotter.camera.parallel_scale = (high - low) / 2
