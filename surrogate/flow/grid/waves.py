"""Cosines and sines across the stream, about the middle of a lattice.

Fields that are their own mirror image, or minus it, are known by their upper half. Others are
split into two such parts.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from surrogate.arrays import AnyArray

Field = tuple[Float[AnyArray, "..."], ...]  # a component each, on its own faces


def halves(field: Field, axis: int) -> Field:
    """Return the upper halves of a field's even and odd part under mirroring, stacked.

    Args:
      field: a component along each axis.
      axis: that is mirrored.
    """
    return tuple(map(jnp.stack, zip(*(half(field, axis, odd) for odd in (0, 1)), strict=True)))


def half(field: Field, axis: int, odd: int | Int[AnyArray, ""]) -> Field:
    """Return the upper half of a field's even part under mirroring, or of its odd part (``odd`` 1).

    The even part is its own mirror image, the odd part minus its mirror image. The component along
    the axis lies on faces: on the mirror plane, where the even part vanishes, and at multiples of
    the step on both sides, one more above it.
    """
    found, sign = [], 1 - 2 * odd
    for own, part in enumerate(field):
        lower, upper = jnp.split(part, [part.shape[axis] // 2], axis)
        image = jnp.flip(lower, axis)
        if own == axis:
            plane, image = jnp.split(-image, [1], axis)
            upper = jnp.concatenate([-plane, upper], axis)
            image = jnp.concatenate([plane, image, jnp.zeros_like(plane)], axis)
        found.append((upper + sign * image) / 2)
    return tuple(found)


def joined(parts: Field, axis: int) -> Field:
    """Return the whole of a field, whose upper halves ``halves`` would return."""
    return tuple(
        _whole(even + odd, even - odd, axis, own == axis) for own, (even, odd) in enumerate(parts)
    )


def joined_part(part: Field, axis: int, odd: Int[AnyArray, ""]) -> Field:
    """Return the whole of a field that has one of the two symmetries, as ``half`` numbers them."""
    sign = 1 - 2 * odd
    return tuple(_whole(upper, sign * upper, axis, own == axis) for own, upper in enumerate(part))


def _whole(upper, image, axis, on_faces):
    """Join the upper half of a component and the mirror image of its lower half."""
    if on_faces:  # the plane is in the upper half, the outermost face has no image
        image = -jax.lax.slice_in_dim(image, 1, image.shape[axis] - 1, axis=axis)
    return jnp.concatenate([jnp.flip(image, axis), upper], axis)


class Waves(NamedTuple):
    """Cosines and sines across a mirror plane: their slopes, and transforms to them and back.

    ``slope`` is D- of the component along the axis, and minus D+ of a scalar. ``centred`` and
    ``faces`` transform values in the middle of cells and on the faces of the axis.
    """

    slope: Float[AnyArray, " waves"]
    centred: tuple[AnyArray, AnyArray]
    faces: tuple[AnyArray, AnyArray]

    def of(self, faces: bool) -> tuple[AnyArray, AnyArray]:
        """Return the transforms of a component, which lies on the faces of the axis or not."""
        return self.faces if faces else self.centred


@functools.cache
def waves_across(cells: int, parity: int, plane: bool) -> Waves:
    """Return the waves of a field that is its own mirror image, or minus that.

    Args:
      cells: above the mirror plane.
      parity: 1 for a field that is its own mirror image, -1 for one that is minus it.
      plane: whether the faces on the mirror plane are the first ones; otherwise they are left out.
    """
    psi = wave_numbers(cells)
    centres = psi * (np.arange(cells)[:, None] + 0.5)
    faces = psi * np.arange(0 if plane else 1, cells + 1)[:, None]
    centres, faces = (
        (np.cos(centres), np.sin(faces)) if parity == 1 else (np.sin(centres), np.cos(faces))
    )
    weight = np.full(len(psi), 2.0) / (2 * cells + 1)
    weight[[0, -1]] /= 2
    back = (centres * weight).T, (faces * weight).T
    if plane:
        faces[0] /= 2  # these values are their own images
    return Waves(parity * 2 * np.sin(psi / 2), (centres, back[0]), (faces, back[1]))


def wave_numbers(cells: int) -> Float[np.ndarray, " waves"]:
    """Return the wave numbers across, enough of them that images of sources do not overlap."""
    return np.pi * np.arange(2 * cells + 2) / (2 * cells + 1)


def contract(
    field: Complex[AnyArray, "kx _ _"], matrix: Float[AnyArray, "_ _"], axis: int
) -> Complex[Array, "kx _ _"]:
    """Apply a real matrix along an axis of a complex field, both parts in one product."""
    parts, matrix = jnp.stack([field.real, field.imag]), jnp.asarray(matrix, field.real.dtype)
    product = jnp.moveaxis(jnp.tensordot(parts, matrix, axes=[[axis + 1], [0]]), -1, axis + 1)
    return product[0] + 1j * product[1]
