"""Pictures of 3-D flows: bodies coloured by surface stress, stream tubes, a slice of vorticity."""

from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.colors import Colormap, ListedColormap

from shapeopt.render.pictures import Panel, title_size, write_caption
from surrogate.files import whole_file
from surrogate.flow.fields import Fields
from surrogate.flow.output.folder import read_flow, read_surface
from surrogate.flow.output.meshes import fields_mesh, pv
from surrogate.flow.output.palette import INK, QUIET

VIEW = (-1.7, 4.2, -1.45, 1.45, -1.45, 1.45)  # x, y and z range shown, in D
SIZE = 820, 560  # pixels of a panel
ASIDE, AHEAD = -25.0, -68.0  # azimuth of the camera in degrees: beside the body, or in front of it
ONWARD = 0.7  # distance behind the body in D that the camera looks at, to show the wake
TURNS, TURNING = 36, (640, 440)  # frames of a turntable, pixels
SEEDS = (0.05, 0.16, 0.3, 0.46, 0.66)  # distances from the axis where streamlines start, in D
AROUND = 9  # streamlines at each distance
LONGEST, SHORT = 12.0, 3.8  # lengths of streamlines in D; short ones leave a turntable's captions
PERCENTILES = 2, 99.5  # of the surface values, ends of the colour scale
COLOURS = 256


class Load(NamedTuple):
    """A quantity that colours a body: an array of its surface mesh, its title and a colour map.

    The middle colour of a ``diverging`` map is that of zero.
    """

    array: str
    title: str
    colours: str
    diverging: bool = False

    def colour_map(self, low: float, high: float) -> Colormap:
        """Return the colour map of values from ``low`` to ``high``."""
        colours = mpl.colormaps[self.colours]
        if not self.diverging:
            return colours
        ends = 0.5 + 0.5 * np.array([low, high]) / max(abs(low), abs(high))
        return ListedColormap(colours(np.linspace(*ends, COLOURS)))


PRESSURE = Load("Cp", "pressure coefficient", "coolwarm", diverging=True)
FRICTION = Load("friction", "friction coefficient", "inferno")


class BodyPanel(NamedTuple):
    """One picture of a sheet: a body in its flow, with a title and a note above it.

    Attributes:
      skin: the surface with arrays Cp, Cf (vectors) and friction = |Cf|.
      flow: velocity over U and |vorticity| over U / D at cell centres within VIEW.
      title: of the picture.
      note: in small print below it.
    """

    skin: pv.PolyData
    flow: pv.ImageData
    title: str
    note: str = ""


def solved_panel(panel: Panel) -> BodyPanel:
    """Return the picture of a solved 3-D flow."""
    solution = panel.solution
    return _panel(solution.surface_mesh(), solution.fields, panel.title, panel.note)


def stored_panel(folder: str | Path) -> BodyPanel:
    """Return the picture of a 3-D flow that ``Solution.write`` left in a folder.

    Raises:
      InvalidInput: there is no readable one.
    """
    stored = read_flow(folder)
    return _panel(read_surface(folder), stored.fields, stored.picture.title)


def _panel(skin: pv.PolyData, fields: Fields, title: str, note: str = "") -> BodyPanel:
    skin["friction"] = np.linalg.norm(skin["Cf"], axis=1)
    ends = zip(fields.axes, np.reshape(VIEW, (3, 2)), strict=True)
    seen = [np.flatnonzero((x > low) & (x < high))[[0, -1]] for x, (low, high) in ends]
    flow = fields_mesh(fields).extract_subset(np.concatenate(seen))
    flow["vorticity"] = np.linalg.norm(flow["vorticity"], axis=1)
    return BodyPanel(skin, flow, title, note)


def render_bodies(
    rows: list[list[BodyPanel]], path: str | Path, load: Load = PRESSURE, azimuth: float = ASIDE
) -> Path:
    """Draw bodies and their flows as a PNG, with one colour scale in each row.

    Args:
      rows: the pictures, row by row.
      path: of the PNG, which is returned.
      load: that colours the bodies.
      azimuth: of the camera in degrees: 0 beside the body, -90 in front of it.
    """
    columns = max(map(len, rows))
    size = SIZE[0] * columns, SIZE[1] * len(rows)
    plotter = pv.Plotter(
        off_screen=True, shape=(len(rows), columns), window_size=size, border=False
    )
    plotter.set_background("white", all_renderers=True)
    for i, row in enumerate(rows):
        loads = np.concatenate([panel.skin[load.array] for panel in row])
        ends = np.percentile(loads, PERCENTILES)
        for j, panel in enumerate(row):
            plotter.subplot(i, j)
            _draw_cut(plotter, panel.flow)
            _draw_tubes(plotter, _streamlines(panel.flow))
            _draw_body(plotter, panel.skin, ends, load, i)
            write_caption(plotter, panel.title, (0.03, 0.93), title_size(13, panel.title))
            write_caption(plotter, panel.note, (0.03, 0.875), 10, QUIET)
            plotter.camera_position = _seen_from(azimuth, ONWARD)
    with whole_file(path) as part:
        plotter.screenshot(str(part))
    plotter.close()
    return Path(path)


def render_turntable(panel: BodyPanel, path: str | Path, load: Load = PRESSURE) -> Path:
    """Draw a GIF of a body and its flow turned around the vertical axis, and return its path.

    Stream tubes are drawn behind the body only; by symmetry those in front look the same.
    """
    skin = panel.skin
    plotter = pv.Plotter(off_screen=True, window_size=TURNING)
    plotter.set_background("white")
    with whole_file(path) as part:
        plotter.open_gif(str(part), fps=10, loop=0)
        lines = _streamlines(panel.flow, SHORT)
        _draw_body(plotter, skin, np.percentile(skin[load.array], PERCENTILES), load)
        far, near = (_draw_tubes(plotter, side) for side in (lines, lines.reflect((0, 1, 0))))
        write_caption(plotter, panel.title, (0.03, 0.93), title_size(10, panel.title))
        for azimuth in 360 * np.arange(TURNS) / TURNS + ASIDE:
            camera, _, _ = plotter.camera_position = _seen_from(azimuth, 0.0)
            far.visibility = bool(camera[1] <= 0)
            near.visibility = not far.visibility
            plotter.write_frame()
        plotter.close()
    return Path(path)


def _draw_cut(plotter: pv.Plotter, flow: pv.ImageData) -> None:
    """Draw the vorticity of the plane y = 0, moved behind the body."""
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


def _draw_tubes(plotter: pv.Plotter, lines: pv.PolyData) -> pv.Actor:
    return plotter.add_mesh(
        lines.tube(radius=0.011),
        scalars="speed",
        cmap="viridis",
        clim=(0, 1.15),
        smooth_shading=True,
        specular=0.3,
        show_scalar_bar=False,
    )


def _draw_body(
    plotter: pv.Plotter, skin: pv.PolyData, ends: np.ndarray, load: Load, row: int = 0
) -> None:
    """Draw the surface and its colour bar; pyvista merges bars of equal titles, so they differ."""
    plotter.add_mesh(
        skin,
        scalars=load.array,
        cmap=load.colour_map(*ends),
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


def _streamlines(flow: pv.ImageData, length: float = LONGEST) -> pv.PolyData:
    """Return streamlines with their speed, from half circles upstream behind the body."""
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
        max_length=length,
        initial_step_length=0.2,
        terminal_speed=5e-3,
    )
    lines["speed"] = np.linalg.norm(lines["velocity"], axis=1)
    return lines


def _seen_from(azimuth: float, onward: float) -> list[tuple[float, ...]]:
    """Return camera position, focus and up vector; azimuth in degrees, slightly from above."""
    angle = np.deg2rad(azimuth)
    away = 6.3 * np.array([np.sin(angle), -np.cos(angle), 0.25])
    focus = np.array([onward, 0.0, -0.12])
    return [tuple(focus + away), tuple(focus), (0, 0, 1)]
