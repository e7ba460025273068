"""Pictures of bodies in space: lit, coloured by their loads, tubes of flow, a cut of vorticity."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from shapeopt.export.solid import pv, skin_mesh
from shapeopt.render.pictures import INK, QUIET, Panel, write_caption
from shapeopt.render.signature import whole_picture
from surrogate.flow.solution import Solution
from surrogate.flow.surface.forces_3d import curl

VIEW = (-1.7, 4.2, -1.45, 1.45, -1.45, 1.45)  # of the flow shown, in D
SIZE = 820, 560  # pixels of a panel
ASIDE, AHEAD = -25.0, -68.0  # degrees: a camera beside the body, or nearly before it
ONWARD = 0.7  # D behind the body's middle that a sheet is centred at, for its wake
TURNS, TURNING = 36, (640, 440)  # frames of a turntable, pixels
SEEDS = (0.05, 0.16, 0.3, 0.46, 0.66)  # distances from the axis where streamlines enter, in D
AROUND = 9  # of them at each distance, behind the body
SHARES = 2, 99.5  # per cent of the points whose loads the colours reach


class Load(NamedTuple):
    """What a body is coloured by: an array of its skin, in words, by which colours."""

    array: str
    title: str
    colours: str


PRESSURE = Load("Cp", "pressure coefficient", "coolwarm")
FRICTION = Load("friction", "friction coefficient", "inferno")


def render_bodies(
    rows: list[list[Panel]], path: str | Path, load: Load = PRESSURE, azimuth: float = ASIDE
) -> Path:
    """A sheet of bodies and their flows, one scale of colours a row.

    Returns the path of the PNG, which is written whole or not at all.
    """
    columns = max(map(len, rows))
    size = SIZE[0] * columns, SIZE[1] * len(rows)
    plotter = pv.Plotter(
        off_screen=True, shape=(len(rows), columns), window_size=size, border=False
    )
    plotter.set_background("white", all_renderers=True)
    for i, row in enumerate(rows):
        skins = [loaded_skin(panel.solution) for panel in row]
        ends = np.percentile(np.concatenate([skin[load.array] for skin in skins]), SHARES)
        for j, (panel, skin) in enumerate(zip(row, skins, strict=True)):
            plotter.subplot(i, j)
            flow = space_mesh(panel.solution)
            _draw_cut(plotter, flow)
            _draw_tubes(plotter, _streamlines(flow))
            _draw_body(plotter, skin, ends, load, i)
            write_caption(plotter, panel.title, (0.03, 0.93), 13)
            write_caption(plotter, panel.note, (0.03, 0.875), 10, QUIET)
            plotter.camera_position = _seen_from(azimuth, ONWARD)
    with whole_picture(path) as part:
        plotter.screenshot(str(part))
    plotter.close()
    return Path(path)


def render_turntable(panel: Panel, path: str | Path, load: Load = PRESSURE) -> Path:
    """A GIF of a body and its flow, seen from all around, where a cut would hide it.

    Tubes are drawn on the far side alone, as by its mirror planes it has the same on both.
    """
    skin = loaded_skin(panel.solution)
    plotter = pv.Plotter(off_screen=True, window_size=TURNING)
    plotter.set_background("white")
    with whole_picture(path) as part:
        plotter.open_gif(str(part), fps=10, loop=0)
        lines = _streamlines(space_mesh(panel.solution))
        _draw_body(plotter, skin, np.percentile(skin[load.array], SHARES), load)
        far, near = (_draw_tubes(plotter, side) for side in (lines, lines.reflect((0, 1, 0))))
        write_caption(plotter, panel.title, (0.03, 0.93), 10)
        for azimuth in 360 * np.arange(TURNS) / TURNS + ASIDE:
            camera, _, _ = plotter.camera_position = _seen_from(azimuth, 0.0)
            far.visibility = bool(camera[1] <= 0)
            near.visibility = not far.visibility
            plotter.write_frame()
        plotter.close()
    return Path(path)


def loaded_skin(solution: Solution) -> pv.PolyData:
    """The closed skin of a solved body with Cp, the friction vector Cf and its size."""
    mesh, areas = skin_mesh(solution.shape)
    mesh["Cp"], mesh["Cf"] = solution.skin_loads(mesh.points.astype(float), areas)
    mesh["friction"] = np.linalg.norm(mesh["Cf"], axis=1)
    return mesh


def space_mesh(solution: Solution) -> pv.ImageData:
    """Velocity over U and vorticity's size over U / D in the cells' middles, of what is shown."""
    lattice = solution.domain.lattice.unfolded
    velocity = solution.velocity
    spin = np.asarray(curl(velocity, lattice.step[0]))
    middles = [
        (component + np.roll(component, 1, own)) / 2 for own, component in enumerate(velocity)
    ]
    edges = []
    for own, part in enumerate(spin):
        for axis in {0, 1, 2} - {own}:
            part = (part + np.roll(part, 1, axis)) / 2
        edges.append(part)
    centres = [
        low + (np.arange(cells) + 0.5) * step
        for (low, _), cells, step in zip(
            lattice.grid.domain, lattice.shape, lattice.step, strict=True
        )
    ]
    ends = np.reshape(VIEW, (3, 2))
    keep = [np.flatnonzero((x > a) & (x < b)) for x, (a, b) in zip(centres, ends, strict=True)]
    box = tuple(slice(k[0], k[-1] + 1) for k in keep)
    mesh = pv.ImageData(
        dimensions=tuple(map(len, keep)),
        spacing=lattice.step,
        origin=[x[k[0]] for x, k in zip(centres, keep, strict=True)],
    )
    mesh["velocity"] = np.stack([m[box].ravel(order="F") for m in middles], axis=1)
    mesh["vorticity"] = np.linalg.norm([e[box].ravel(order="F") for e in edges], axis=0)
    return mesh


def _draw_cut(plotter, flow):
    """The vorticity of the middle plane, drawn behind the body."""
    middle = flow.slice("y", origin=(0, 1e-3, 0))
    plotter.add_mesh(
        middle.translate((0, VIEW[3], 0)),
        scalars=np.sqrt(middle["vorticity"]),
        cmap="Greys",
        clim=(0, np.sqrt(np.percentile(middle["vorticity"], 99.5))),
        opacity=0.55,
        lighting=False,
        show_scalar_bar=False,
    )


def _draw_tubes(plotter, lines):
    return plotter.add_mesh(
        lines.tube(radius=0.011),
        scalars="speed",
        cmap="viridis",
        clim=(0, 1.15),
        smooth_shading=True,
        specular=0.3,
        show_scalar_bar=False,
    )


def _draw_body(plotter, skin, ends, load, row=0):
    """The lit skin; bars of the same title would share one scale."""
    plotter.add_mesh(
        skin,
        scalars=load.array,
        cmap=load.colours,
        clim=tuple(ends),
        smooth_shading=True,
        specular=0.35,
        specular_power=25,
        scalar_bar_args={
            "title": load.title + " " * row,
            "vertical": False,
            "position_x": 0.55,
            "position_y": 0.04,
            "width": 0.4,
            "height": 0.07,
            "color": INK,
            "n_labels": 2,
            "fmt": "%.1f",
            "title_font_size": 15,
            "label_font_size": 13,
        },
    )


def _streamlines(flow):
    """Lines that start in half circles upstream, beyond the body, with their speed."""
    angles = np.pi * (np.arange(AROUND) + 0.5) / AROUND
    starts = [
        (flow.bounds[0] + 0.05, radius * np.sin(angle), radius * np.cos(angle))
        for radius in SEEDS
        for angle in angles
    ]
    lines = flow.streamlines_from_source(
        pv.PolyData(np.array(starts)),
        vectors="velocity",
        integration_direction="forward",
        max_length=12.0,
        initial_step_length=0.2,
        terminal_speed=5e-3,
    )
    lines["speed"] = np.linalg.norm(lines["velocity"], axis=1)
    return lines


def _seen_from(azimuth, onward):
    """A camera that looks slightly down on the body, turned about the vertical by degrees."""
    angle = np.deg2rad(azimuth)
    away = 6.3 * np.array([np.sin(angle), -np.cos(angle), 0.25])
    focus = np.array([onward, 0.0, -0.12])
    return [tuple(focus + away), tuple(focus), (0, 0, 1)]
