"""Retraction: how far inside a smeared wall the fluid rests.

A force on the grid is smeared over a few cells. The smeared sheet of force at a wall lets the fluid
slip there, as if the wall were further inside the body by a fraction R of a cell. ``retraction``
derives R from the lattice; ``surrogate/flow/README.md`` has the derivation.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.lattice import Lattice

# R of walls across an axis, across a square's diagonal and across a cube's diagonal: the integral
# in ``retraction``, which tests/test_error_estimate.py evaluates in 2-D, to 1e-3.
ALONG_AXIS, DIAGONAL_2D, DIAGONAL_3D = 239 / 840, 0.3058, 0.3126


def retraction(unit: Float[AnyArray, "nodes axes"]) -> Float[Array, " nodes"]:
    """Return the retraction R in cells, averaged over the wall's position in the grid.

    A sheet of tangential force smeared by the spline B drives a shear flow that is smeared
    likewise. Its B-weighted mean at the sheet is not zero but the shear times

        R = (1 / 2 pi) int (1 / k^2 - |B(k n)|^2 / lambda(k n)) dk,

    n the wall's normal, B the spline's Fourier transform, lambda the eigenvalue of the lattice
    Laplacian. R is interpolated between its exact values along the axes and the diagonals.
    """
    squares = unit**2
    oblique = 2 * (1 - jnp.sum(squares**2, axis=1))  # 1 along the diagonals of a square
    mean = ALONG_AXIS + (DIAGONAL_2D - ALONG_AXIS) * oblique
    if unit.shape[1] == 2:
        return mean
    cube = 27 * (DIAGONAL_3D - ALONG_AXIS - 4 / 3 * (DIAGONAL_2D - ALONG_AXIS))
    return mean + cube * jnp.prod(squares, axis=1)


def offset_correction(offset: Float[AnyArray, "..."]) -> Float[Array, "..."]:
    """Return the deviation of R from its mean for a sheet ``offset`` cells off a row of the grid.

    The sheet lies along an axis. There R = E|J - K| / 2 for rows J, K of the tangential velocity
    drawn with the spline's weights: from 320/1152 on a row to 335/1152 between two, very nearly a
    cosine. Without it the drag oscillates as a flat side moves through the grid; along oblique
    walls it averages out.
    """
    return -5 / 768 * jnp.cos(2 * np.pi * offset)


def mean_step(lattice: Lattice) -> float:
    """Return h, the geometric mean of the cell's sides in D."""
    return float(np.prod(lattice.step) ** (1 / len(lattice.step)))


def retract(
    lattice: Lattice,
    points: Float[AnyArray, "nodes axes"],
    unit: Float[AnyArray, "nodes axes"],
    second_order: Float[AnyArray, ""] | float,
    share: Float[AnyArray, ""] | float,
) -> tuple[Float[Array, "nodes axes"], Float[Array, "nodes 1"]]:
    """Move markers into the body by R h (1 + R h c), of which only a share is taken.

    Args:
      lattice: the grid, h its mean step.
      points: the markers, in D.
      unit: outward unit normals.
      second_order: c, per D.
      share: of the retraction, from 0 to 1.

    Returns:
      The retracted markers in D, and R in cells where they are.
    """
    h = mean_step(lattice)

    def moved(cells):
        return points - share * h * (cells + cells**2 * h * second_order) * unit

    cells = retraction_at(lattice, moved(retraction(unit)[:, None]), unit)
    return moved(cells), cells


def retraction_at(
    lattice: Lattice, points: Float[AnyArray, "nodes axes"], unit: Float[AnyArray, "nodes axes"]
) -> Float[Array, "nodes 1"]:
    """Return R in cells at points of the grid, with its deviation from the mean.

    Args:
      lattice: the grid.
      points: on the sheet, in D.
      unit: its unit normals.
    """
    offset = points / np.array(lattice.step) - 0.5  # tangential velocity: half a cell off 0
    correction = offset_correction(offset) * unit**2
    return retraction(unit)[:, None] + jnp.sum(correction, axis=1, keepdims=True)
