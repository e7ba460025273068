"""Forces on a body in 3-D, and the pressure and friction on its skin."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.skin import Skin
from surrogate.flow.grid.domain_3d import Domain3D
from surrogate.flow.loads import Coefficients, drag, lift, moment
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.surface.pressure import pressure, surface_pressure
from surrogate.flow.surface.probes import VORTICITY_PROBES, extrapolation_weights, keys_weights


def coefficients_3d(
    domain: Domain3D, skin: Skin, state: FlowState, reynolds: float
) -> Coefficients:
    """Return the force coefficients of a solved 3-D flow, its drag split by the skin's pressure.

    The arguments are those of ``force_coefficients``.
    """
    at = domain.modes, state.amplitude, skin
    cp = surface_pressure(domain, *skin, pressure(domain, skin, state, reynolds))
    along = np.asarray(skin.areas)[:, 0]
    each = domain.modes.weights(skin.nodes) * skin.nodes.parts
    by_pressure = -4 / np.pi * np.sum(each * cp * along)
    return Coefficients(drag(*at), by_pressure, drag(*at) - by_pressure, lift(*at), moment(*at))


class SkinLoads(NamedTuple):
    """The loads on a skin over (1/2) rho U^2: Cp, zero far upstream, and the friction vector."""

    cp: Float[np.ndarray, " points"]
    friction: Float[np.ndarray, "points 3"]


def skin_loads(
    domain: Domain3D,
    velocity: Float[AnyArray, "3 nx ny nz"],
    p: Float[np.ndarray, "..."],
    reynolds: float,
    points: Float[AnyArray, "points 3"],
    areas: Float[AnyArray, "points 3"],
) -> SkinLoads:
    """Return the loads at points of a solved body's skin.

    Args:
      domain: the discrete problem.
      velocity: of the flow's state, on the domain's faces.
      p: pressure over rho U^2 in the cells of the whole lattice.
      reynolds: U D / nu.
      points: where the loads are wanted, in D.
      areas: outward area vectors there, of any length.
    """
    stress = friction(domain, points, areas, velocity, reynolds)
    return SkinLoads(surface_pressure(domain, points, areas, p), np.asarray(stress))


def friction(
    domain: Domain3D,
    points: Float[AnyArray, "points 3"],
    areas: Float[AnyArray, "points 3"],
    velocity: Float[AnyArray, "3 nx ny nz"],
    reynolds: float,
) -> Float[Array, "points 3"]:
    """Return the friction over (1/2) rho U^2: 2 nu omega x n, extrapolated to the wall.

    Args:
      domain: the discrete problem.
      points: of the skin, in D.
      areas: outward area vectors there, of any length.
      velocity: u' or u on the domain's faces.
      reynolds: U D / nu.
    """
    unit = areas / jnp.linalg.norm(areas, axis=1, keepdims=True)
    h = domain.lattice.step[0]
    near = _vorticity_near(domain, velocity)
    probed = [near(points + k * h * unit) for k in VORTICITY_PROBES]
    weights = extrapolation_weights(VORTICITY_PROBES)
    vorticity = sum(w * values for w, values in zip(weights, probed, strict=True))
    return 2 / reynolds * jnp.cross(vorticity, unit)


def curl(velocity: Float[AnyArray, "3 nx ny nz"], step: float) -> Float[Array, "3 nx ny nz"]:
    """Return the vorticity on the cells' upper edges: component i at the middle along axis i.

    ``step`` is the cell size, equal along all axes.
    """

    def slope(own, axis):
        return (jnp.roll(velocity[own], -1, axis) - velocity[own]) / step

    cyclic = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    return jnp.stack([slope(k, j) - slope(j, k) for _, j, k in cyclic])


def _vorticity_near(domain, velocity):
    """Return the vorticity near the body as a function of points."""
    lattice, margin = domain.lattice, 6
    along = slice(
        max(lattice.inlet - domain.box[0] // 2 - margin, 0),
        lattice.inlet + domain.box[0] // 2 + margin,
    )
    rows, part = [], velocity[:, along]
    for axis in (1, 2):
        folded = axis in lattice.folded
        middle = 0 if folded else lattice.shape[axis] // 2
        rows.append(min(domain.box[axis] // 2 + margin, lattice.shape[axis] - middle))
        part = part.take(np.arange(0 if folded else middle - rows[-1], middle + rows[-1]), axis + 1)
    field = curl(lattice.unfold(part), lattice.step[0])
    low = np.array([along.start - lattice.inlet, -rows[0], -rows[1]])

    def vorticity(points):
        places = points / lattice.step[0] - low
        values = [
            _interpolated(field[own], places - 1 + 0.5 * (np.arange(3) == own)) for own in range(3)
        ]
        return jnp.stack(values, axis=1)

    return vorticity


def _interpolated(field, places):
    """Return a field at places in units of its cells, by cubic convolution."""
    first = jnp.floor(places).astype(int) - 1
    index = first[:, None] + np.arange(4)[:, None]  # (points, 4, axes)
    i, j, k = jnp.moveaxis(index, 2, 0)
    values = field[i[:, :, None, None], j[:, None, :, None], k[:, None, None, :]]
    weights = keys_weights(places[:, None] - index)
    return jnp.einsum("pijk,pi,pj,pk->p", values, *jnp.moveaxis(weights, 2, 0))
