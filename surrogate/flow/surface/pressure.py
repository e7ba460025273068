"""Pressure of a solved flow, recovered from the momentum equation, on the grid and on the surface.

The traction modes carry the drag but split it badly on slender bodies, so the surface pressure is
extrapolated from the flow outside of the smeared layer.
"""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import map_coordinates

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.surface.probes import PRESSURE_PROBES, extrapolation_weights


def pressure(
    domain: Domain, markers: Markers, state: FlowState, reynolds: float
) -> Float[np.ndarray, "..."]:
    """Return p / rho U^2 in the cells of the whole domain, zero far away.

    grad p is the body force minus the momentum equation's terms in the velocity. It has no curl on
    the grid, except for the interpolated far field, so any path of integration will do. The path
    starts in the middle of the inflow side, where the total head is still the stream's: viscous
    losses upstream of it fall off as exp(-Re r), 1 % of Cp at Re 1.
    """
    lattice = domain.lattice.unfolded
    body = domain.spread_body(markers, reynolds)
    force = np.asarray(domain.lattice.unfold(body.spread(state.amplitude)))
    velocity = np.asarray(domain.lattice.unfold(state.velocity))
    gradient = force - momentum_defect(lattice, velocity, reynolds)
    margin = round(1.5 / lattice.step[0])  # cells at the edge, where convection is blended out
    middle = (margin, *(count // 2 for count in lattice.shape[1:]))
    field = np.zeros(lattice.shape)
    for axis, step in enumerate(lattice.step):  # along the middles of the axes before this one
        along = np.cumsum(gradient[axis][middle[:axis]], axis=0) * step
        along = np.concatenate([np.zeros_like(along[:1]), along[:-1]])
        field += along - along[middle[axis]]
    entry = tuple(slice(index - 1, index + 1) for index in middle)
    stream = [component[entry].mean() for component in velocity]
    stream[0] += 1
    head = 0.5 - np.square(stream).sum() / 2
    return field - field[entry].mean() + head


def surface_pressure(
    domain: Domain,
    points: Float[AnyArray, "nodes axes"],
    normal: Float[AnyArray, "nodes axes"],
    field: Float[np.ndarray, "..."],
) -> Float[np.ndarray, " nodes"]:
    """Return Cp at points of a surface, extrapolated from the pressure some cells off the wall."""
    lattice, h = domain.lattice.unfolded, domain.lattice.step[0]
    points, normal = np.asarray(points), np.asarray(normal)
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    origin = np.array([lattice.inlet, *(count / 2 for count in lattice.shape[1:])]) - 0.5
    probed = [
        map_coordinates(
            field, ((points + k * h * unit) / lattice.step + origin).T, order=3, mode="nearest"
        )
        for k in PRESSURE_PROBES
    ]
    return 2 * extrapolation_weights(PRESSURE_PROBES) @ np.array(probed)


def momentum_defect(
    lattice: Lattice, velocity: Float[AnyArray, "axes ..."], reynolds: float
) -> Float[np.ndarray, "axes ..."]:
    """Return f - grad p of the perturbation u': the momentum equation's terms in the velocity.

    These are D0x u' - nu Lap u' + div(w^2 u' u') by the discrete operators on the whole domain.
    """
    u = np.asarray(velocity)

    def shift(axis, cells):
        return np.roll(u, -cells, axis=axis + 1)

    stream = (shift(0, 1) - shift(0, -1)) / (2 * lattice.step[0])
    friction = sum(
        (shift(axis, 1) - 2 * u + shift(axis, -1)) / step**2
        for axis, step in enumerate(lattice.step)
    )
    convection = np.asarray(lattice.convect(lattice.cutoff() * u))
    return stream - friction / reynolds - convection
