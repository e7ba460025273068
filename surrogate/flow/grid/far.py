"""The far field: the non-linear momentum flux outside the computational domain, to second order.

Far from the body the perturbation is the Oseenlet of the total force, u' ~ Fx u_x + Fy u_y, so the
momentum flux outside the domain is quadratic in the force and its response inside is
``Fx^2 Phi_xx + Fx Fy Phi_xy + Fy^2 Phi_yy``: smooth fields, computed on coarse grids. Forces are in
the units of the traction modes; Fy stands for the lift, in 3-D along z; flows without lift have
Phi_xx alone.
"""

import functools
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import CubicSpline

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import bspline
from surrogate.flow.grid.lattice import Lattice

BLENDING_CELLS = 6  # width of a coarse lattice's blending function, in its cells


def far_response(
    domain: Domain, reynolds: Float[AnyArray, ""]
) -> Float[AnyArray, "terms axes ..."]:
    """Return Phi_xx (and Phi_xy, Phi_yy where there is lift) on the domain's faces.

    Each of the nested lattices, ever coarser and larger, adds what lies outside the one before.
    """
    inside, band, total = domain.lattice, 1.0, 0.0
    for coarse in domain.far:
        inner = inside.profile(coarse.faces(), band)
        total += _ring(domain, coarse, inner, reynolds)
        inside, band = coarse, _band(coarse)
    return total


def _ring(domain, coarse, inner, reynolds):
    """Return the response to the flux between the domain ``inner`` and the edge of ``coarse``."""
    green = domain.green_function(coarse, reynolds)
    outer = np.maximum(coarse.cutoff(_band(coarse)), inner)

    def flux_outside(u):
        """-div((W^2 - w^2) u u), W and w the blending functions outside and inside."""
        return coarse.convect(outer * u) - coarse.convect(inner * u)

    u_x = green(_unit_force(coarse, 0, domain.FORCE_UNIT))
    sources = [flux_outside(u_x)]
    if domain.modes.lift_index is not None:
        u_y = green(_unit_force(coarse, coarse.dimension - 1, domain.FORCE_UNIT))
        sources += [
            (flux_outside(u_x + u_y) - flux_outside(u_x - u_y)) / 2,
            flux_outside(u_y),
        ]
    refine = refinement(domain.lattice, coarse)
    return jnp.stack([refine(green(source)) for source in sources])


def far_velocity(
    response: Float[AnyArray, "terms axes ..."], force: Float[AnyArray, " 2"]
) -> Float[AnyArray, "axes ..."]:
    """Return the velocity in the domain due to the flux outside it, for a total force."""
    products = jnp.stack([force[0] ** 2, force[0] * force[1], force[1] ** 2])
    return jnp.tensordot(products[: response.shape[0]], response, axes=1)


def _unit_force(coarse, own, unit):
    """Return the density of a unit force at the origin along axis ``own``."""
    faces = zip(coarse.faces()[own], coarse.step, strict=True)
    density = functools.reduce(jnp.multiply.outer, [bspline(x / step) for x, step in faces])
    density = density * (unit / np.prod(coarse.step))
    return jnp.zeros((coarse.dimension, *coarse.shape)).at[own].set(density)


def _band(coarse):
    return BLENDING_CELLS * coarse.step[0]


def refinement(lattice: Lattice, coarse: Lattice) -> Callable[[Array], Array]:
    """Return a function that interpolates a field from the faces of ``coarse`` to ``lattice``.

    Cubic splines, as small dense matrices; with the lattices exchanged it samples the finer field.
    """

    def parity(axis, own):
        return (-1 if axis == own else 1) if axis in coarse.folded else 0

    def walled(axis, own):
        return axis == own > 0 and coarse.periodic and axis not in coarse.folded

    matrices = [
        [
            _spline(xf, xc, parity(axis, own), walled(axis, own))
            for axis, (xf, xc) in enumerate(zip(*faces, strict=True))
        ]
        for own, faces in enumerate(zip(lattice.faces(), coarse.faces(), strict=True))
    ]

    def refine(field):
        for axis in range(lattice.dimension):
            field = [
                jnp.moveaxis(jnp.tensordot(of[axis], part, axes=[[1], [axis]]), 0, axis)
                for of, part in zip(matrices, field, strict=True)
            ]
        return jnp.stack(field)

    return refine


def _spline(fine, rough, parity=0, walled=False):
    """Return the matrix from values at ``rough`` to values at ``fine``.

    With a parity (1 even, -1 odd) the mirror image of the values is added first. ``walled``: the
    function vanishes on the lower wall, one step below the first of ``rough``.
    """
    values, knots = np.eye(len(rough)), rough
    if parity:
        values = np.concatenate([parity * values[::-1], values])
        knots = np.append(-rough[::-1], rough)
    if parity < 0:  # an odd function vanishes on the mirror plane
        values = np.insert(values, len(rough), 0.0, axis=0)
        knots = np.insert(knots, len(rough), 0.0)
    if walled:
        values = np.insert(values, 0, 0.0, axis=0)
        knots = np.insert(knots, 0, 2 * rough[0] - rough[1])
    return CubicSpline(knots, values)(fine)
