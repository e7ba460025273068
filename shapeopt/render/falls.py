"""Falls: the path of a body with the body on it, Reynolds number and incidence over time."""

from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib import rc_context
from matplotlib.figure import Figure

from shapeopt.free_fall import Fall
from shapeopt.render.figures import OPTIMUM, START, STYLE, save_figure
from surrogate.arrays import AnyArray
from surrogate.body.body_class import BodyClass
from surrogate.body.incidence import rotate
from surrogate.flow.settling import Particle

BODIES, NODES = 14, 96  # along the path, and of each contour
STEEPEST = 6.0  # height over width of the picture of the path


def plot_fall(
    found: Fall,
    body_class: BodyClass,
    body: Float[AnyArray, " parameters"],
    particle: Particle,
    path: str | Path,
) -> Path:
    """Plot the path of a fall, and Re and incidence over time, and return the picture's path.

    Args:
      found: the fall.
      body_class: of the body.
      body: its parameters; it is drawn on the path, at a size that can be seen.
      particle: for the title.
      path: of the picture.
    """
    travelled = np.hypot(np.gradient(found.x), np.gradient(found.z)).cumsum()
    even = np.linspace(travelled[0], travelled[-1], BODIES)
    marks = np.searchsorted(travelled, even).clip(0, travelled.size - 1)
    size = 0.6 * (travelled[-1] - travelled[0]) / BODIES
    outline = size * np.asarray(body_class.outline(body, NODES))
    with rc_context(STYLE):
        figure = Figure(figsize=(10, 6), layout="constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.6))
        plane = figure.add_subplot(grid[:, 0])
        plane.plot(1e3 * found.x, 1e3 * found.z, color=START, lw=1)
        for k in marks:
            # outlines have the nose at -x: turned by 180 degrees less the tilt, nose up
            turned = np.asarray(rotate(outline, 180 - found.tilt[k]))
            centre = np.array([found.x[k], found.z[k]])
            plane.fill(*(1e3 * (turned + centre)).T, color=OPTIMUM, alpha=0.8, lw=0)
        plane.set(xlabel="x, mm", ylabel="z, mm", aspect="equal")
        longest = np.linalg.norm(outline, axis=1).max()
        width = max(np.ptp(found.x) + 2 * longest, np.ptp(found.z) / STEEPEST)
        middle = (found.x.max() + found.x.min()) / 2
        plane.set_xlim(*(1e3 * (middle + side * 0.55 * width) for side in (-1, 1)))
        for row, values, label in (
            (0, found.reynolds, "Reynolds number"),
            (1, np.unwrap(found.incidence, period=360), "incidence to the velocity, degrees"),
        ):
            axis = figure.add_subplot(grid[row, 1])
            axis.plot(found.time, values, color=OPTIMUM, lw=1.8)
            axis.set(xlabel="time, s", ylabel=label)
        ratio, millimetres = particle.density_ratio, 1e3 * particle.size
        motion = "Fall" if found.z[-1] < found.z[0] else "Rise"
        title = f"{motion} of a body of {millimetres:.3g} mm, density ratio {ratio:g}"
        title += f", drawn {size / particle.size:.2g} times as large"
        figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
        return save_figure(figure, path)
