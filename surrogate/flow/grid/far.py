"""The far field: the non-linear momentum flux outside the computational domain, as a power series.

Far from the body the perturbation is, but for the moments of the force, a series in the total force
F: the Oseenlets F_i u_i, then the velocity F_i F_j u_ij that their momentum flux causes, and so on.
So the flux outside the domain is a polynomial of F, and so is its response Phi inside,

    Phi(F) = F_i F_j Phi_ij + F_i F_j F_k Phi_ijk + ...,

whose coefficients are smooth fields, computed on coarse grids. Forces are in the units of the
traction modes; F has a drag, and a lift along the last axis where there is no mirror plane.
"""

import functools
import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import CubicSpline

from surrogate.arrays import AnyArray, weighted_sum
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import bspline
from surrogate.flow.grid.lattice import Lattice

BLENDING_CELLS = 6  # width of a coarse lattice's blending function, in its cells

# Drags and lifts: a homogeneous polynomial of order n is known from its values at the first n + 1.
FORCES = ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0))

Powers = tuple[int, ...]  # of every force in a term of a polynomial


class Polynomial(NamedTuple):
    """A polynomial of the forces: the powers of its terms, and the fields that they multiply."""

    powers: list[Powers]
    fields: Float[Array, "terms axes ..."]


def far_response(
    domain: Domain, reynolds: Float[AnyArray, ""]
) -> Float[AnyArray, "terms axes ..."]:
    """Return the coefficients of Phi on the domain's faces, in the order of ``far_powers``.

    Each of the nested lattices, ever coarser and larger, adds what lies outside the one before.
    The terms of the highest order fall off fastest and are taken from the first lattice alone.
    """
    inside, band, total = domain.lattice, 1.0, {}
    for level, coarse in enumerate(domain.far):
        inner = inside.profile(coarse.faces(), band)
        order = domain.far_order if level == 0 else 2
        with jax.default_matmul_precision("highest"):  # GPUs would round to 10 bits
            ring = _ring(domain, coarse, inner, reynolds, order)
        for powers, field in zip(*ring, strict=True):
            total[powers] = total.get(powers, 0.0) + field
        inside, band = coarse, _band(coarse)
    if domain.modes.lift_index is not None:  # exactly, which rounding has spoilt
        symmetrised = domain.lattice.symmetrised
        total = {p: symmetrised(field, (-1.0) ** p[-1]) for p, field in total.items()}
    return jnp.stack([total[powers] for powers in far_powers(domain)])


def far_powers(domain: Domain) -> list[Powers]:
    """Return the powers of the forces in the terms of Phi: of second order, then of third."""
    forces = len(_force_axes(domain))
    return [powers for order in range(2, domain.far_order + 1) for powers in _powers(forces, order)]


def _powers(forces, order):
    """Return the powers of the forces in the terms of one order."""
    every = itertools.product(range(order, -1, -1), repeat=forces)
    return [powers for powers in every if sum(powers) == order]


def _force_axes(domain):
    """Return the axes of the forces: the first for the drag, the last for the lift."""
    return (0,) if domain.modes.lift_index is None else (0, domain.lattice.dimension - 1)


def _ring(domain, coarse, inner, reynolds, order) -> Polynomial:
    """Return the response to the flux between the domain ``inner`` and the edge of ``coarse``.

    With u_1 and u_2 the velocities of first and second order and q(u) the flux of a velocity, that
    of second order is q(u_1), and that of third (q(u_1 + u_2) - q(u_1 - u_2)) / 2.
    """
    axes = _force_axes(domain)
    precision = domain.FAR_PRECISION
    green = domain.green_function(coarse, reynolds, precision)
    outer = np.maximum(coarse.cutoff(_band(coarse)), inner)
    inner, outer = inner.astype(precision), outer.astype(precision)
    refine = refinement(domain.lattice, coarse)

    def fluxes(velocity):
        """Return -div(W^2 u u) in all and outside the domain, W being ``outer``."""
        whole, inside = (coarse.convect(weight * velocity) for weight in (outer, inner))
        return whole, whole - inside

    forces = [_unit_force(coarse, axis, domain.FORCE_UNIT) for axis in axes]
    forces = Polynomial(_powers(len(axes), 1), jnp.stack(forces).astype(precision))
    first = _convolved(green, forces)
    found = jax.lax.map(fluxes, _values(first, 2))
    flux, outside = (_polynomial(values, len(axes), 2) for values in found)
    powers, fields = outside
    if order > 2:
        one, two = (_values(velocity, 3) for velocity in (first, _convolved(green, flux)))
        _, outside = jax.lax.map(fluxes, jnp.concatenate([one + two, one - two]))
        cubic = _polynomial((outside[: len(one)] - outside[len(one) :]) / 2, len(axes), 3)
        powers, fields = powers + cubic.powers, jnp.concatenate([fields, cubic.fields])
    return _convolved(green, Polynomial(powers, fields), refine)


def _convolved(green, polynomial, then=lambda velocity: velocity) -> Polynomial:
    """Return the polynomial with G, and then another linear function, applied to each field.

    One after the other, as everywhere here: a loop is compiled once, while a call for each field
    takes seconds more. Fields are odd under mirroring across the axis of the lift where its power
    is odd.
    """
    powers, fields = polynomial
    if len(powers[0]) == 1:
        return Polynomial(powers, jax.lax.map(lambda field: then(green(field)), fields))
    odd = np.array([lift % 2 for _, lift in powers])
    fields = jax.lax.map(lambda one: then(green.of_parity(*one)), (fields, odd))
    return Polynomial(powers, fields)


def _values(polynomial, order):
    """Return the values of a polynomial at the forces that determine one of this order."""
    weights = _monomials(polynomial.powers, order).astype(polynomial.fields.dtype)
    return jnp.tensordot(weights, polynomial.fields, axes=1)


def _polynomial(values, forces, order) -> Polynomial:
    """Return the homogeneous polynomial of this order in the forces that has these values."""
    powers = _powers(forces, order)
    weights = np.linalg.inv(_monomials(powers, order)).astype(values.dtype)
    return Polynomial(powers, jnp.tensordot(weights, values, axes=1))


def _monomials(powers, order):
    """Return the terms with these powers, by columns, at the forces that determine an order."""
    count = len(powers[0])
    forces = np.array(FORCES)[: len(_powers(count, order)), :count]
    return np.prod(forces[:, None] ** np.array(powers, float), axis=-1)


def far_velocity(
    response: Float[AnyArray, "terms axes ..."],
    force: Float[AnyArray, " 2"],
    powers: list[Powers],
) -> Float[AnyArray, "axes ..."]:
    """Return the velocity Phi in the domain due to the flux outside it, for a total force.

    Args:
      response: coefficients from ``far_response``.
      force: drag and lift; the lift is unused where the powers have that of the drag alone.
      powers: from ``far_powers``.
    """
    terms = [math.prod(f**p for f, p in zip(force, power, strict=False)) for power in powers]
    return weighted_sum(jnp.stack(terms), response)


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


def _spline(fine, rough, parity, walled):
    """Return the matrix from values at ``rough`` to values at ``fine``.

    With a parity (1 even, -1 odd, 0 for none) the mirror image of the values is added first.
    ``walled``: the function vanishes on the lower wall, one step below the first of ``rough``.
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
