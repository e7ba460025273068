"""Forces on a body in space, and the pressure and friction on its skin."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.skin import QUARTERS, Skin
from surrogate.flow.grid.domain import Domain
from surrogate.flow.loads.forces import PROBES, Coefficients, drag_coefficient, keys_weights
from surrogate.flow.loads.pressure import pressure, surface_pressure
from surrogate.flow.solver.steady import FlowState


def space_coefficients(
    domain: Domain, skin: Skin, state: FlowState, reynolds: float
) -> Coefficients:
    """Drag from mode 0, its part by pressure from that near the skin; no lift, no moment."""
    drag = drag_coefficient(state.amplitude)
    cp = surface_pressure(domain, *skin, pressure(domain, skin, state, reynolds))
    along = np.asarray(skin.areas)[:, 0]
    by_pressure = -4 / np.pi * QUARTERS * np.sum(domain.modes.weights(skin.nodes) * cp * along)
    return Coefficients(drag, by_pressure, drag - by_pressure, 0.0, 0.0)


class SkinLoads(NamedTuple):
    """Over (1/2) rho U^2: Cp, zero far upstream, and the friction, a vector along the skin."""

    cp: Float[np.ndarray, " points"]
    friction: Float[np.ndarray, "points 3"]


def skin_loads(
    domain: Domain,
    skin: Skin,
    state: FlowState,
    reynolds: float,
    points: Float[AnyArray, "points 3"],
    areas: Float[AnyArray, "points 3"],
) -> SkinLoads:
    """Loads at any points of a solved body's skin, given with their area vectors."""
    field = pressure(domain, skin, state, reynolds)
    stress = friction(domain, points, areas, state.velocity, reynolds)
    return SkinLoads(surface_pressure(domain, points, areas, field), np.asarray(stress))


def friction(
    domain: Domain,
    points: Float[AnyArray, "points 3"],
    areas: Float[AnyArray, "points 3"],
    velocity: Float[AnyArray, "3 nx ny nz"],
    reynolds: float,
) -> Float[AnyArray, "points 3"]:
    """Friction on the skin over (1/2) rho U^2: 2 nu omega x n, extrapolated to the wall."""
    unit = areas / jnp.linalg.norm(areas, axis=1, keepdims=True)
    h = domain.lattice.step[0]
    near = _around(domain, velocity)
    probed = [near(points + k * h * unit) for k in PROBES]
    weights = np.linalg.solve(np.vander(PROBES, increasing=True).T, np.eye(len(PROBES))[0])
    vorticity = sum(w * values for w, values in zip(weights, probed, strict=True))
    return 2 / reynolds * jnp.cross(vorticity, unit)


def curl(velocity: Float[AnyArray, "3 nx ny nz"], step: float) -> Float[AnyArray, "3 nx ny nz"]:
    """Vorticity on the edges of the cells: component i in the middle along i, upper elsewhere."""

    def slope(own, axis):
        return (jnp.roll(velocity[own], -1, axis) - velocity[own]) / step

    cyclic = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    return jnp.stack([slope(k, j) - slope(j, k) for _, j, k in cyclic])


def _around(domain, velocity):
    """The vorticity of any points near the body: a function from (points, 3) to the same."""
    lattice, margin = domain.lattice, 6
    along = slice(
        max(lattice.inlet - domain.box[0] // 2 - margin, 0),
        lattice.inlet + domain.box[0] // 2 + margin,
    )
    sides = zip(domain.box[1:], lattice.shape[1:], strict=True)
    rows = [min(side // 2 + margin, cells) for side, cells in sides]
    part = velocity[:, along, : rows[0], : rows[1]]
    field = curl(lattice.unfold(part), lattice.step[0])
    low = np.array([(along.start - lattice.inlet), -rows[0], -rows[1]])

    def vorticity(points):
        places = points / lattice.step[0] - low
        values = [
            _interpolated(field[own], places - 1 + 0.5 * (np.arange(3) == own)) for own in range(3)
        ]
        return jnp.stack(values, axis=1)

    return vorticity


def _interpolated(field, places):
    """Cubic convolution (Keys 1981) of a field at places in units of its cells."""
    first = jnp.floor(places).astype(int) - 1
    index = first[:, None] + np.arange(4)[:, None]  # (points, 4, axes)
    i, j, k = jnp.moveaxis(index, 2, 0)
    values = field[i[:, :, None, None], j[:, None, :, None], k[:, None, None, :]]
    weights = keys_weights(places[:, None] - index)
    return jnp.einsum("pijk,pi,pj,pk->p", values, *jnp.moveaxis(weights, 2, 0))
