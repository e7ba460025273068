"""Force coefficients and wall friction of a solved 2-D flow."""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.compilation import compiled
from surrogate.flow.grid.domain_2d import Domain2D
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.wall_2d import outward
from surrogate.flow.loads import Coefficients, drag, lift, moment
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.surface.probes import VORTICITY_PROBES, extrapolation_weights, keys_weights


def coefficients_2d(
    domain: Domain2D, markers: Float[AnyArray, "nodes 2"], state: FlowState, reynolds: float
) -> Coefficients:
    """Return the force coefficients of a solved 2-D flow, its drag split by the wall's friction.

    The arguments are those of ``force_coefficients``.
    """
    return _coefficients(domain, markers, state, jnp.asarray(reynolds, float))


@compiled("domain")
def _coefficients(domain, markers, state, reynolds):
    """Split the drag by the friction of the wall vorticity; pressure drag is the rest.

    The traction modes themselves do not split it: the smeared layer carries part of the pressure
    gradient along the wall as a tangential force, an error of first order in h.
    """
    at = domain.modes, state.amplitude, markers
    shear = friction_coefficient(domain, markers, state.velocity, reynolds)
    friction = 2 * jnp.pi * jnp.mean(shear * outward(markers)[:, 1])
    return Coefficients(drag(*at), drag(*at) - friction, friction, lift(*at), moment(*at))


@functools.partial(jax.jit, static_argnames="domain", inline=True)
def friction_coefficient(
    domain: Domain2D,
    markers: Float[AnyArray, "nodes 2"],
    velocity: Float[AnyArray, "2 nx ny"],
    reynolds: Float[AnyArray, ""],
) -> Float[AnyArray, " nodes"]:
    """Return Cf = -2 nu omega along a clockwise contour, extrapolated to the wall.

    Args:
      domain: the discrete problem.
      markers: of the contour, at equidistant t.
      velocity: u' or u on the domain's faces.
      reynolds: U D / nu.
    """
    normal = outward(markers)
    unit = normal / jnp.linalg.norm(normal, axis=1)[:, None]
    h, lattice = domain.lattice.step[0], domain.lattice.unfolded
    field = vorticity(lattice, domain.lattice.unfold(velocity))
    probed = [
        _interpolated(lattice, domain.box, field, markers + k * h * unit) for k in VORTICITY_PROBES
    ]
    weights = extrapolation_weights(VORTICITY_PROBES)
    return -2 / reynolds * sum(w * values for w, values in zip(weights, probed, strict=True))


def vorticity(lattice: Lattice, velocity: Float[AnyArray, "2 nx ny"]) -> Float[AnyArray, "nx ny"]:
    """Return dv/dx - du/dy at the upper right corner of every cell."""
    u, v = velocity
    dx, dy = lattice.step
    return (jnp.roll(v, -1, axis=0) - v) / dx - (jnp.roll(u, -1, axis=1) - u) / dy


def _interpolated(lattice, box, corner_field, points):
    """Return a corner field at points near the body, by cubic convolution."""
    margin = 6
    (x, _), (_, y) = lattice.faces()
    i0, j0 = lattice.inlet - box[0] // 2, lattice.shape[1] // 2 - box[1] // 2
    i = slice(max(i0 - margin, 0), i0 + box[0] + margin)
    j = slice(max(j0 - margin, 0), j0 + box[1] + margin)
    wx = keys_weights((points[:, :1] - x[i]) / lattice.step[0])
    wy = keys_weights((points[:, 1:] - y[j]) / lattice.step[1])
    return jnp.einsum("ki,ij,kj->k", wx, corner_field[i, j], wy, optimize="optimal")
