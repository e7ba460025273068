"""Measures of contours: area, centroid, thickness, mean line; radii of curvature."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray, Number, array_module

AREA = np.pi / 4  # of every 2-D body unless its size is kept: the equivalent diameter D is 1
ANGLES = np.linspace(0, np.pi, 181)  # t from the nose to the tail
STATIONS = 128  # along the stream, where the thickness across it is measured
SIDES = ANGLES[20:161:2]  # where the thickness is bounded: not at the ends, where it vanishes


class Radii(NamedTuple):
    """Radii of curvature in D: at the nose, at the tail, and the least one between them."""

    nose: Float[AnyArray, ""]
    tail: Float[AnyArray, ""]
    side: Float[AnyArray, ""]


class StreamwiseProfile(NamedTuple):
    """Measures of a contour as it lies in the stream; lengths are in D.

    Attributes:
      length: side of its box along the stream.
      height: side of its box across the stream.
      thickness: greatest distance, across the stream, of its upper from its lower side.
      rise: height of the front end above the rear end of the straight line that fits its mean
        line, midway between the two sides, by least squares; of a body that is longer than tall
        positive at positive incidence.
      arch: height above its chord of the parabola that fits the rest of the mean line by least
        squares; positive where the mean line is cambered upwards.
      front: area of the front half over that of the ellipse of this length and thickness.
      rear: the same of the rear half.
    """

    length: Float[AnyArray, ""]
    height: Float[AnyArray, ""]
    thickness: Float[AnyArray, ""]
    rise: Float[AnyArray, ""]
    arch: Float[AnyArray, ""]
    front: Float[AnyArray, ""]
    rear: Float[AnyArray, ""]


def moments(
    markers: Float[AnyArray, "nodes 2"],
) -> tuple[Number, Float[AnyArray, " 2"]]:
    """Return the signed area (positive when clockwise) and the area centroid of a polygon.

    NumPy computes those of NumPy's arrays, for which JAX would compile for every number of nodes.
    """
    following = array_module(markers).roll(markers, -1, axis=0)
    cross = markers[:, 1] * following[:, 0] - markers[:, 0] * following[:, 1]
    area = cross.sum() / 2
    return area, ((markers + following) * cross[:, None]).sum(axis=0) / (6 * area)


def mean_thickness(markers: Float[AnyArray, "nodes 2"]) -> Float[AnyArray, ""]:
    """Return area over half the perimeter, in D: the thickness of a slender body."""
    edges = jnp.roll(markers, -1, axis=0) - markers
    return jnp.abs(moments(markers)[0]) * 2 / jnp.linalg.norm(edges, axis=1).sum()


@jax.jit
def least_mean_thickness(
    outline: Float[AnyArray, "nodes 2"], flatness: Float[AnyArray, ""]
) -> Float[AnyArray, ""]:
    """Return the mean thickness in D of a body's thinnest view across its chord.

    Args:
      outline: contour in the side view at zero incidence.
      flatness: width over height, 1 in 2-D.
    """
    thinnest_view = jnp.stack([1.0, jnp.minimum(flatness, 1.0)])
    return mean_thickness(thinnest_view * outline)


@jax.jit
def streamwise_profile(contour: Float[AnyArray, "nodes 2"]) -> StreamwiseProfile:
    """Return measures of a contour as it lies in the stream, from its sides at many stations."""
    x, y = jnp.asarray(contour).T
    after, above = jnp.roll(x, -1), jnp.roll(y, -1)
    stations = (np.arange(STATIONS) + 0.5) / STATIONS
    length = jnp.ptp(x)
    at = jnp.min(x) + length * stations[:, None]
    crossed = (x - at) * (after - at) <= 0
    sides = y + (above - y) * (at - x) / jnp.where(after == x, 1.0, after - x)
    upper = jnp.max(jnp.where(crossed, sides, -jnp.inf), axis=1)
    lower = jnp.min(jnp.where(crossed, sides, jnp.inf), axis=1)
    along, line = stations - 0.5, (upper + lower) / 2
    rise = -(along @ line) / (along @ along)
    parabola = np.mean(along**2) - along**2
    arch = parabola @ line / (parabola @ parabola) / 4
    thickness = jnp.max(upper - lower)
    halves = jnp.mean((upper - lower).reshape(2, STATIONS // 2), axis=1)
    front, rear = 4 / np.pi * halves / thickness
    return StreamwiseProfile(length, jnp.ptp(y), thickness, rise, arch, front, rear)


def least(values: Float[AnyArray, " values"]) -> Float[AnyArray, ""]:
    """Return the least value, with a derivative that is finite at ties.

    The derivative of ``jnp.min`` is 0 / 0 at some ties.
    """
    return values[jnp.argmin(values)]
