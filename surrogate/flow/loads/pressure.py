"""Pressure of a solved flow, recovered from the momentum equation: on the grid, on the surface.

The traction modes carry the drag but split it badly on slender bodies, so the surface pressure is
taken from the flow outside the smeared layer.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.ndimage import map_coordinates

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import outward, spread_modes
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.solver.steady import FlowState

NEAR = (1.5, 2.5, 3.5)  # cells off the wall: pressure is smooth there, so closer than vorticity


def pressure(
    domain: Domain, markers: Float[AnyArray, "nodes 2"], state: FlowState, reynolds: float
) -> Float[np.ndarray, "nx ny"]:
    """p / rho U^2 in the cells of the whole window, zero far away.

    grad p is what the momentum equation leaves: body force minus everything that is velocity. It
    has no curl on the grid, but for the interpolated far field: any path will do. Where the path
    starts, in the middle of the window's inflow side, the total head is still the stream's: what
    viscosity took upstream of it falls off as exp(-Re r), 1 % of Cp at Re 1.
    """
    lattice = domain.lattice.unfolded
    body = spread_modes(domain.lattice, domain.modes, domain.box, jnp.asarray(markers))
    force = np.asarray(domain.lattice.unfold(body.spread(state.amplitude)))
    velocity = np.asarray(domain.lattice.unfold(state.velocity))
    gradient = force - momentum_defect(lattice, velocity, reynolds)
    (dx, dy), (_, rows) = lattice.step, lattice.shape
    margin = round(1.5 / dx)  # of the window, where convection is cut off
    column = np.concatenate([[0.0], np.cumsum(gradient[1, margin, :-1]) * dy])
    along = np.cumsum(gradient[0], axis=0) * dx
    field = column + np.concatenate([np.zeros((1, rows)), along[:-1]]) - along[margin - 1]
    entry = (slice(margin - 1, margin + 1), slice(rows // 2 - 1, rows // 2 + 1))
    u, v = velocity[0][entry].mean(), velocity[1][entry].mean()
    head = 0.5 - ((1 + u) ** 2 + v**2) / 2
    return field - field[entry].mean() + head


def surface_pressure(
    domain: Domain,
    markers: Float[AnyArray, "nodes 2"],
    field: Float[np.ndarray, "nx ny"],
) -> Float[np.ndarray, " nodes"]:
    """Cp along a contour: the pressure some cells off the wall, extrapolated to it."""
    lattice, h = domain.lattice.unfolded, domain.lattice.step[0]
    normal = np.asarray(outward(jnp.asarray(markers)))
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    origin = np.array([lattice.inlet, lattice.shape[1] / 2]) - 0.5
    probed = [
        map_coordinates(
            field,
            ((np.asarray(markers) + k * h * unit) / lattice.step + origin).T,
            order=3,
            mode="nearest",
        )
        for k in NEAR
    ]
    weights = np.linalg.solve(np.vander(NEAR, increasing=True).T, np.eye(len(NEAR))[0])
    return 2 * weights @ np.array(probed)


def momentum_defect(
    lattice: Lattice, velocity: Float[AnyArray, "2 nx ny"], reynolds: float
) -> Float[np.ndarray, "2 nx ny"]:
    """f - grad p of the perturbation u': all of the momentum equation that is velocity.

    Uses the discrete operators on the whole window: D0x u' - nu Lap u' + div(w^2 u' u').
    """
    u = np.asarray(velocity)
    dx, dy = lattice.step

    def shift(a, columns, rows):
        return np.roll(a, (-columns, -rows), axis=(1, 2))

    stream = (shift(u, 1, 0) - shift(u, -1, 0)) / (2 * dx)
    friction = (shift(u, 1, 0) - 2 * u + shift(u, -1, 0)) / dx**2
    friction += (shift(u, 0, 1) - 2 * u + shift(u, 0, -1)) / dy**2
    convection = np.asarray(lattice.convect(lattice.cutoff() * u))
    return stream - friction / reynolds - convection
