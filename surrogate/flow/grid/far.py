"""What the window cuts off: the non-linear term of the far field, known up to the force squared.

Far from the body u' is the Oseenlet of the total force, u' ~ Fx u_x + Fy u_y, so the momentum
flux outside the window is quadratic in the force and its response inside the window is
``Fx^2 Phi_xx + Fx Fy Phi_xy + Fy^2 Phi_yy``: smooth fields, made on a coarse grid. Forces count in
the unit of the traction modes. In space there is no lift.
"""

import functools
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from surrogate.arrays import AnyArray
from surrogate.flow.grid.immersed import bspline
from surrogate.flow.grid.kernel import make_kernel
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes import SPACE_UNIT


def far_response(
    lattice: Lattice,
    nested: tuple[Lattice, ...],
    reynolds: Float[AnyArray, ""],
    height: float | None,
    lift: bool,
) -> Float[AnyArray, "terms axes ..."]:
    """Phi_xx (and Phi_xy, Phi_yy with ``lift``) on the window's faces.

    Each of the ``nested`` lattices, ever coarser and larger, adds what lies outside the one before.
    """
    inside, band, total = lattice, 1.0, 0.0
    for coarse in nested:
        window = inside.profile(coarse.faces(), band)
        total += _ring(lattice, coarse, window, reynolds, height, lift)
        inside, band = coarse, _band(coarse)
    return total


def _ring(lattice, coarse, inner, reynolds, height, lift):
    """What convects between the window ``inner`` and the cut-off of ``coarse``."""
    kernel = make_kernel(coarse, reynolds, height, mirrored=lift and height is not None)
    outer = np.maximum(coarse.cutoff(_band(coarse)), inner)

    def outside(u):
        """-div((W^2 - w^2) u u): what convects outside the window."""
        return coarse.convect(outer * u) - coarse.convect(inner * u)

    u_x = kernel(_unit_force(coarse, 0))
    sources = [outside(u_x)]
    if lift:
        u_y = kernel(_unit_force(coarse, 1))
        sources += [(outside(u_x + u_y) - outside(u_x - u_y)) / 2, outside(u_y)]
    refine = refinement(lattice, coarse)
    return jnp.stack([refine(kernel(source)) for source in sources])


def far_velocity(
    response: Float[AnyArray, "terms axes ..."], force: Float[AnyArray, " 2"]
) -> Float[AnyArray, "axes ..."]:
    """Velocity in the window due to the momentum flux outside it, for a total force."""
    products = jnp.stack([force[0] ** 2, force[0] * force[1], force[1] ** 2])
    return jnp.tensordot(products[: response.shape[0]], response, axes=1)


def _unit_force(coarse, own):
    """The unit of force in one direction, at the origin."""
    faces = zip(coarse.faces()[own], coarse.step, strict=True)
    density = functools.reduce(jnp.multiply.outer, [bspline(x / step) for x, step in faces])
    unit = SPACE_UNIT if coarse.dimension == 3 else 1.0
    density = density * (unit / np.prod(coarse.step))
    return jnp.zeros((coarse.dimension, *coarse.shape)).at[own].set(density)


def _band(coarse):
    """Width of a coarse lattice's cut-off."""
    return 6 * coarse.step[0]


def refinement(lattice: Lattice, coarse: Lattice) -> Callable:
    """Interpolation of a field from the faces of ``coarse`` to those of ``lattice``.

    By cubic splines, as small dense matrices; the other way round it samples.
    """

    def parity(axis, own):
        return (-1 if axis == own else 1) if coarse.symmetric and axis > 0 else 0

    def walled(axis, own):
        return axis == own > 0 and coarse.periodic and not coarse.symmetric

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
    """Values at ``rough`` to values at ``fine``; with a parity the mirror image is added first.

    ``walled``: the function vanishes on the lower wall, one step below the first of ``rough``.
    """
    values, knots = np.eye(len(rough)), rough
    if parity:
        values, knots = (
            np.concatenate([parity * values[::-1], values]),
            np.append(-rough[::-1], rough),
        )
    if parity < 0:  # an odd function vanishes on the centre line
        values, knots = (
            np.insert(values, len(rough), 0.0, axis=0),
            np.insert(knots, len(rough), 0.0),
        )
    if walled:
        values = np.insert(values, 0, 0.0, axis=0)
        knots = np.insert(knots, 0, 2 * rough[0] - rough[1])
    return CubicSpline(knots, values)(fine)
