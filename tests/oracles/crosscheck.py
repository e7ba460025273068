"""The force twice more, from the velocity field alone: a box's momentum balance, the far wake.

Neither uses the traction, the Green's function or a pressure solve.
"""

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.surface.pressure import momentum_defect


def force_by_momentum(
    lattice: Lattice,
    velocity: Float[AnyArray, "2 nx ny"],
    reynolds: float,
    reach: tuple[float, float],
) -> Float[np.ndarray, " 2"]:
    """Force of the fluid on the body from the momentum that leaves a box of half sides ``reach``.

    The pressure on the box comes from integrating the momentum equation along its sides, where
    there is no body force.
    """
    defect = momentum_defect(lattice, velocity, reynolds)
    dx, dy = lattice.step
    i0, i1 = (lattice.inlet + round(s * reach[0] / dx) for s in (-1, 1))
    j0, j1 = (lattice.shape[1] // 2 + round(s * reach[1] / dy) for s in (-1, 1))
    # the box holds cells i0 < i <= i1, j0 < j <= j1; p relative to its lower left corner
    along_x = -np.cumsum(defect[0, i0 : i1 + 1, :], axis=0) * dx  # p[i0 + 1 ...] - p[i0]
    along_y = -np.cumsum(defect[1, :, j0 : j1 + 1], axis=1) * dy
    left = np.concatenate([[0.0], along_y[i0]])  # p at rows j0 ... j1 + 1 of column i0
    bottom = np.concatenate([[0.0], along_x[:, j0]])  # p at columns i0 ... i1 + 1 of row j0
    right = bottom[-1] + np.concatenate([[0.0], along_y[i1 + 1]])
    top = left[-1] + np.concatenate([[0.0], along_x[:, j1 + 1]])
    inside = (slice(i0, i1 + 1), slice(j0 + 1, j1 + 1))
    force_x = defect[0][inside].sum() * dx * dy + (right - left)[1:-1].sum() * dy
    inside = (slice(i0 + 1, i1 + 1), slice(j0, j1 + 1))
    force_y = defect[1][inside].sum() * dx * dy + (top - bottom)[1:-1].sum() * dx
    return -np.array([force_x, force_y])


def drag_by_wake(
    lattice: Lattice, velocity: Float[AnyArray, "2 nx ny"], reynolds: float, station: float
) -> float:
    """Drag coefficient from a wake survey ``station`` D behind the body.

    Fx = int (H0 - H) dy - (1/2) int (u'^2 - v'^2) dy - 2 nu int du'/dx dy, the total head H from
    dH/dy = -u omega + nu domega/dx; what the window cuts off at its sides is left out.
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
