"""Measures of contours: area, centroid, thickness, mean line; radii of curvature."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray

AREA = np.pi / 4  # of every 2-D body unless its size is kept: the equivalent diameter D is 1
ANGLES = np.linspace(0, np.pi, 181)  # t from the nose to the tail
STATIONS = 64  # along the stream, where the thickness across it is measured
SIDES = ANGLES[20:161:2]  # where the thickness is bounded: not at the ends, where it vanishes


class Radii(NamedTuple):
    """Radii of curvature in D: at the nose, at the tail, and the least one between them."""

    nose: Float[AnyArray, ""]
    tail: Float[AnyArray, ""]
    side: Float[AnyArray, ""]


class StreamwiseProfile(NamedTuple):
    """A contour as it lies in the stream, in D.

    Attributes:
      length: side of its box along the stream.
      thickness: greatest distance, across the stream, of its upper from its lower side.
      rise: side of the box across the stream of its mean line, midway between the two.
    """

    length: Float[AnyArray, ""]
    thickness: Float[AnyArray, ""]
    rise: Float[AnyArray, ""]


@jax.jit
def moments(
    markers: Float[AnyArray, "nodes 2"],
) -> tuple[Float[AnyArray, ""], Float[AnyArray, " 2"]]:
    """Signed area (positive when clockwise) and area centroid of a polygon."""
    following = jnp.roll(markers, -1, axis=0)
    cross = markers[:, 1] * following[:, 0] - markers[:, 0] * following[:, 1]
    area = jnp.sum(cross) / 2
    return area, jnp.sum((markers + following) * cross[:, None], axis=0) / (6 * area)


def mean_thickness(markers: Float[AnyArray, "nodes 2"]) -> Float[AnyArray, ""]:
    """Return area over half the perimeter, in D: the thickness of a slender body."""
    edges = jnp.roll(markers, -1, axis=0) - markers
    return jnp.abs(moments(markers)[0]) * 2 / jnp.linalg.norm(edges, axis=1).sum()


def least_mean_thickness(
    outline: Float[AnyArray, "nodes 2"], extent: Float[AnyArray, " axes"]
) -> Float[AnyArray, ""]:
    """Return the mean thickness in D of a body's thinnest view across the stream.

    Args:
      outline: contour in the side view.
      extent: length, (in 3-D width,) and height, all in D or all halved.
    """
    thinnest_view = jnp.stack([1.0, jnp.min(extent[1:]) / extent[-1]])
    return mean_thickness(thinnest_view * outline)


@jax.jit
def streamwise_profile(contour: Float[AnyArray, "nodes 2"]) -> StreamwiseProfile:
    """Return length, thickness and rise of the mean line of a contour as it lies in the stream."""
    x, y = jnp.asarray(contour).T
    after, above = jnp.roll(x, -1), jnp.roll(y, -1)
    length = jnp.ptp(x)
    stations = jnp.min(x) + length * (np.arange(STATIONS)[:, None] + 0.5) / STATIONS
    crossed = (x - stations) * (after - stations) <= 0
    share = (stations - x) / jnp.where(after == x, 1.0, after - x)
    sides = y + (above - y) * share
    upper = jnp.max(jnp.where(crossed, sides, -jnp.inf), axis=1)
    lower = jnp.min(jnp.where(crossed, sides, jnp.inf), axis=1)
    return StreamwiseProfile(length, jnp.max(upper - lower), jnp.ptp(upper + lower) / 2)


def least(values: Float[AnyArray, " values"]) -> Float[AnyArray, ""]:
    """Least value, differentiable: the derivative of ``jnp.min`` is 0 / 0 at some ties."""
    return values[jnp.argmin(values)]
