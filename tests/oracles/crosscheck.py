"""Loads on a body from the velocity alone: momentum through a box around it, survey of its wake.

Neither uses the traction, the Green's function or a pressure solve.
"""

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.surface.pressure import momentum_defect


def loads_by_momentum(
    lattice: Lattice,
    velocity: Float[AnyArray, "2 nx ny"],
    reynolds: float,
    half_sides: tuple[float, float],
) -> Float[np.ndarray, " 3"]:
    """Return (Cd, Cl, Cm) from the stress and momentum flux through a box around the body.

    The force on the body is the integral of t = -p n + nu (grad u + grad u^T) n - u (u . n) over
    the box, its moment about the origin, nose up, that of y t_x - x t_y. The box runs through cell
    centres (trapezoidal rule, second order in h). Its pressure, up to a constant, comes from
    integrating the momentum equation once around it, where there is no body force.

    Args:
      velocity: perturbation u' = u - (1, 0) on the faces of ``lattice``, without symmetry.
      half_sides: of the box, in D, along and across the stream.
    """
    step, (i, j) = np.array(lattice.step), _box(lattice, half_sides)
    to_next = np.stack([np.roll(i, -1) - i, np.roll(j, -1) - j])  # cells, counterclockwise
    along_x, along_y = momentum_defect(lattice, velocity, reynolds) * step[:, None, None]
    rise_x = to_next[0] * along_x[np.minimum(i, i + to_next[0]), j]
    rise_y = to_next[1] * along_y[i, np.minimum(j, j + to_next[1])]
    pressure = -np.cumsum(np.roll(rise_x + rise_y, 1))
    side = np.stack([to_next[1] * step[1], -to_next[0] * step[0]])  # outward normal times length
    normal = (side + np.roll(side, 1, axis=1)) / 2
    u, gradient = (field[..., i, j] for field in _at_centres(lattice, velocity))
    friction = (gradient + gradient.transpose(1, 0, 2)) / reynolds
    t = np.einsum("abk,bk->ak", friction, normal)
    t -= pressure * normal + u * np.sum(u * normal, axis=0)
    (_, y), (x, _) = lattice.faces()
    return 2 * np.array([*t.sum(axis=1), np.sum(y[j] * t[0] - x[i] * t[1])])


def _box(lattice, half_sides):
    """Indices of the cells whose centres lie on the box, counterclockwise from lower left."""
    (_, y), (x, _) = lattice.faces()
    i0, i1 = (int(np.argmin(np.abs(x - s * half_sides[0]))) for s in (-1, 1))
    j0, j1 = (int(np.argmin(np.abs(y - s * half_sides[1]))) for s in (-1, 1))
    right, up, left, down = (
        np.arange(*ends) for ends in ((i0, i1), (j0, j1), (i1, i0, -1), (j1, j0, -1))
    )
    return (
        np.concatenate([right, np.full(up.size, i1), left, np.full(down.size, i0)]),
        np.concatenate([np.full(right.size, j0), up, np.full(left.size, j1), down]),
    )


def _at_centres(lattice, velocity):
    """Total velocity (2, nx, ny) and its gradient (component, axis, nx, ny) at cell centres."""
    u, v = np.asarray(velocity)
    total = np.stack([u + np.roll(u, 1, axis=0), v + np.roll(v, 1, axis=1)]) / 2
    total[0] += 1
    slopes = [
        (np.roll(total, -1, axis + 1) - np.roll(total, 1, axis + 1)) / (2 * step)
        for axis, step in enumerate(lattice.step)
    ]
    gradient = np.stack(slopes, axis=1)
    for axis, face in enumerate((u, v)):  # across its own cell a component is known on both faces
        gradient[axis, axis] = (face - np.roll(face, 1, axis)) / lattice.step[axis]
    return total, gradient


def drag_by_wake(
    lattice: Lattice, velocity: Float[AnyArray, "2 nx ny"], reynolds: float, station: float
) -> float:
    """Return Cd from a survey of the wake ``station`` D behind the body.

    Fx = int (H0 - H) dy - (1/2) int (u'^2 - v'^2) dy - 2 nu int du'/dx dy, the total head H from
    dH/dy = -u omega + nu domega/dx; what the domain cuts off at its sides is left out.
    """
    u, v = np.asarray(velocity)
    dx, dy = lattice.step
    (x, _), (_, y) = lattice.faces()
    i = int(np.argmin(np.abs(x - station)))
    omega = (np.roll(v, -1, axis=0) - v) / dx - (np.roll(u, -1, axis=1) - u) / dy
    omega[:, -1] = 0.0  # wraps around
    corner_u = (u + np.roll(u, -1, axis=1)) / 2
    corner_v = (v + np.roll(v, -1, axis=0)) / 2
    slope = (omega[i + 1] - omega[i - 1]) / (2 * dx) / reynolds
    head_loss = np.sum(y * (slope - (1 + corner_u[i]) * omega[i]))
    squares = np.sum(corner_u[i] ** 2 - corner_v[i] ** 2) / 2
    stretch = np.sum(u[i + 1] - u[i - 1]) / dx / reynolds
    return float(2 * (head_loss - squares - stretch) * dy)
