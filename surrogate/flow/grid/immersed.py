"""The immersed body: traction modes spread to the grid, slip tested by the same modes.

The spreading operator B turns mode amplitudes a into a force density B a on the grid's faces, by
cubic B-splines around the body's markers. Its transpose, times the cell volume, is the operator S
that averages a velocity over the surface: the slip. Where the markers lie and which slip law holds
is the wall treatment (``wall_2d``, ``wall_3d``); the notes are in ``surrogate/flow/README.md``.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray, weighted_sum
from surrogate.body.skin import Skin
from surrogate.flow.grid.lattice import Lattice

Markers = Float[AnyArray, "nodes 2"] | Skin


class Wall(NamedTuple):
    """The discretised surface of a body: markers, the traction of every mode there, and slip law.

    Attributes:
      points: where forces are spread, in D: the markers, in 3-D at high Re moved into the body.
      values: traction of every mode at the markers.
      weights: quadrature weights of the markers.
      normal: outward area vectors per unit surface parameter.
      compliance: matrix added to S G B: L of the slip law, zero where there is none, and what is
        added for conditioning.
      rings: (rings, markers a ring) of the part of the surface that is gridded (3-D); None where
        the markers are those of the whole contour (2-D).
    """

    points: Float[AnyArray, "nodes axes"]
    values: Float[AnyArray, "modes axes nodes"]
    weights: Float[AnyArray, " nodes"]
    normal: Float[AnyArray, "nodes axes"]
    compliance: Float[AnyArray, "#modes #modes"]
    rings: tuple[int, int] | None = None


class Spreading(eqx.Module):
    """Force densities B of all modes on a box of the domain around the body.

    Attributes:
      density: B, the force density of every mode on the faces of the box.
      null_mode: unit vector of the amplitudes of a uniform pressure, which moves no fluid.
      compliance: of the wall, a matrix added to S G B.
      corner: index of the box's first cell along each axis.
      shape: cells of the whole lattice.
      volume: cell volume, its mirror images included.
    """

    density: Float[AnyArray, "modes axes ..."]
    null_mode: Float[AnyArray, " modes"]
    compliance: Float[AnyArray, "#modes #modes"]
    corner: tuple[int, ...] = eqx.field(static=True)
    shape: tuple[int, ...] = eqx.field(static=True)
    volume: float = eqx.field(static=True)

    @property
    def _box(self):
        sides = zip(self.corner, self.density.shape[2:], strict=True)
        return (slice(None), *(slice(start, start + side) for start, side in sides))

    def spread(self, amplitude: Float[AnyArray, " modes"]) -> Float[AnyArray, "axes ..."]:
        """Return the force density B a on the faces of the whole lattice."""
        local = weighted_sum(amplitude, self.density)
        return jnp.zeros((len(self.shape), *self.shape), local.dtype).at[self._box].set(local)

    def slip(self, velocity: Float[AnyArray, "axes ..."]) -> Float[AnyArray, " modes"]:
        """Return S u, the mode-weighted mean of a velocity over the surface."""
        flat = self.density.reshape(len(self.density), -1)
        return self.volume * (flat @ velocity[self._box].reshape(-1))

    def slip_of_stream(self) -> Float[AnyArray, " modes"]:
        """Return S of the undisturbed stream, U = 1 along x."""
        along = self.density[:, 0]
        return self.volume * jnp.sum(along, axis=tuple(range(1, along.ndim)))


def spread_modes(lattice: Lattice, box: tuple[int, ...], wall: Wall) -> Spreading:
    """Spread all traction modes of a body's wall onto a box of the lattice."""
    corner, sides = _placed(lattice, box)
    components, spread = [], _summed if wall.rings is None else _scattered
    for own, face in enumerate(lattice.faces()):
        placed = zip(face, corner, sides, strict=True)
        near = [x[start : start + side] for x, start, side in placed]
        components.append(spread(lattice, wall, own, near))
    density = jnp.stack(components, axis=1) / float(np.prod(lattice.step))
    null_mode = jnp.einsum("mck,kc->m", wall.values * wall.weights, wall.normal)
    return Spreading(
        density,
        null_mode / jnp.linalg.norm(null_mode),
        wall.compliance,
        corner,
        lattice.shape,
        lattice.cell_volume,
    )


def _placed(lattice, box):
    """Return the first cell and the sides of the box; a folded lattice holds the upper half."""
    corner, sides = [lattice.inlet - box[0] // 2], [box[0]]
    for axis in range(1, lattice.dimension):
        half, folded = box[axis] // 2, axis in lattice.folded
        corner.append(0 if folded else lattice.shape[axis] // 2 - half)
        sides.append(half if folded else 2 * half)
    return tuple(corner), tuple(sides)


def _summed(lattice, wall, own, faces):
    """Sum over all markers of every mode's value times the product of the splines (2-D)."""
    splines = [
        bspline((wall.points[:, axis, None] - x) / lattice.step[axis])
        for axis, x in enumerate(faces)
    ]
    values = wall.values[:, own] * wall.weights
    return jnp.einsum("mk,ki,kj->mij", values, *splines, optimize="optimal")


def _scattered(lattice, wall, own, faces):
    """Add each marker's values, times its splines, to the cells that the splines reach (3-D)."""
    index, weight = zip(
        *(_stencil(lattice, wall.points[:, axis], axis, own, x) for axis, x in enumerate(faces)),
        strict=True,
    )

    @jax.checkpoint
    def ring(total, parts):
        values, (i, j, k), (x, y, z) = parts
        cells = i[:, :, None, None], j[:, None, :, None], k[:, None, None, :]
        spline = x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]
        return total.at[cells].add(spline[..., None] * values[:, None, None, None]), None

    # All markers at once would take gigabytes.
    values = (wall.values[:, own] * wall.weights).T
    parts = jax.tree.map(
        lambda part: jnp.reshape(part, (*wall.rings, *part.shape[1:])), (values, index, weight)
    )
    zeros = jnp.zeros((*(len(x) for x in faces), values.shape[1]))
    return jnp.moveaxis(jax.lax.scan(ring, zeros, parts)[0], -1, 0)


def _stencil(lattice, coordinate, axis, own, faces):
    """Return which faces the splines of markers reach along one axis, and with which weights.

    Faces beyond a mirror plane are those of the image: component ``own`` is odd along its own axis
    and vanishes on the plane.
    """
    place = (coordinate - faces[0]) / lattice.step[axis]
    index = jnp.floor(place).astype(int)[:, None] + np.arange(-1, 3)
    weight = bspline(place[:, None] - index)
    if axis in lattice.folded:
        odd, beyond = axis == own, index < 0
        index = jnp.where(beyond, -(2 if odd else 1) - index, index)
        weight = jnp.where(beyond & odd, -weight, weight)
    inside = (index >= 0) & (index < len(faces))
    return jnp.where(inside, index, 0), jnp.where(inside, weight, 0.0)


def slip_law(
    values: Float[AnyArray, "modes axes nodes"],
    unit: Float[AnyArray, "nodes axes"],
    weights: Float[AnyArray, " nodes"],
) -> Float[Array, "modes modes"]:
    """Return the matrix L of the slip law: modes against modes, both along the wall.

    A sheet of traction t on the wall itself moves the fluid there as if the wall were R h further
    in: the spline-weighted mean of a true flow's velocity, which does not slip, is -R h Re t.
    Unlike retracted markers this leaves the fluid inside the body at rest and the wall tight.

    Args:
      values: traction of every mode at the markers, per unit surface parameter.
      unit: outward unit normals.
      weights: of the markers, times the compliance R h Re per unit surface parameter.
    """
    along = values - jnp.sum(values * unit.T, axis=1, keepdims=True) * unit.T
    return jnp.einsum("mck,nck,k->mn", along, along, weights)


def bspline(r: Float[AnyArray, "..."]) -> Float[Array, "..."]:
    """Return the cubic B-spline of support |r| < 2, whose integral is 1."""
    a = jnp.abs(r)
    near, far = jnp.maximum(1 - a, 0.0), jnp.maximum(2 - a, 0.0)
    return (far**3 - 4 * near**3) / 6
