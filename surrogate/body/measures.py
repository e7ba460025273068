"""What is measured on a body: moments of any contour; of a family body exact lengths, in D."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.form import Form
from surrogate.body.solid import half_axes

AREA = np.pi / 4  # of every body unless its size is kept: the equivalent diameter D is 1
ANGLES = np.linspace(0, np.pi, 181)  # from the nose to the tail
SIDES = ANGLES[20:161:2]


class Radii(NamedTuple):
    """Radius of curvature at the nose, at the tail, and the least one between them."""

    nose: Float[AnyArray, ""]
    tail: Float[AnyArray, ""]
    side: Float[AnyArray, ""]


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
    """Return area over half the perimeter of a contour: the thickness of a slender body."""
    edges = jnp.roll(markers, -1, axis=0) - markers
    return jnp.abs(moments(markers)[0]) * 2 / jnp.linalg.norm(edges, axis=1).sum()


def chord(parameters: Float[AnyArray, " parameters"], form: Form) -> Float[AnyArray, ""]:
    """Length along the stream."""
    return 2 * _halves(parameters, form)[0]


def thickness(parameters: Float[AnyArray, " parameters"], form: Form) -> Float[AnyArray, ""]:
    """Greatest thickness across the stream; in space the height."""
    return 2 * -least(-_height(parameters, form, ANGLES))


def thicknesses(
    parameters: Float[AnyArray, " parameters"], form: Form
) -> Float[AnyArray, " sides"]:
    """Thickness every two degrees of t; between them a body is at most 0.02 % thicker."""
    return 2 * _height(parameters, form, SIDES)


def thickness_at(
    parameters: Float[AnyArray, " parameters"], form: Form, station: Float[AnyArray, ""]
) -> Float[AnyArray, ""]:
    """Thickness at x/c = ``station``: 0 is the nose, 1 the tail."""
    return 2 * _height(parameters, form, jnp.arccos(1 - 2 * station))


def radii(parameters: Float[AnyArray, " parameters"], form: Form) -> Radii:
    """Radii of curvature of the contour, convex or hollow: |r'|^3 / |x' y'' - y' x''|.

    In space, of the outline seen from the side.
    """
    half = chord(parameters, form) / 2
    t = ANGLES
    x1, x2 = half * np.sin(t), half * np.cos(t)
    y1, y2 = _height(parameters, form, t, 1), _height(parameters, form, t, 2)
    speed = jnp.sqrt(x1**2 + y1**2 + 1e-12)
    curvature = jnp.abs(x1 * y2 - y1 * x2) / speed**3
    return Radii(y1[0] ** 2 / half, y1[-1] ** 2 / half, -1 / least(-curvature[1:-1]))


def least(values: Float[AnyArray, " values"]) -> Float[AnyArray, ""]:
    """The least value; its derivative is one value's, where that of a minimum can be 0 / 0."""
    return values[jnp.argmin(values)]


def _halves(parameters, form):
    """Half the length, and half the thickness of an ellipse before the modes."""
    if form.dimension == 3:
        return half_axes(parameters, form)[::2]
    root = jnp.sqrt(form.aspect(parameters))
    return root / 2, 1 / (2 * root)


def _height(parameters, form, t, derivative=0):
    """y or a derivative of it in t, half the thickness of an ellipse times the modes."""
    turn = derivative * np.pi / 2
    waves = zip((1, *form.modes), (1.0, *form.betas(parameters)), strict=True)
    half = _halves(parameters, form)[1]
    return half * sum(beta * k**derivative * jnp.sin(k * t + turn) for k, beta in waves)
