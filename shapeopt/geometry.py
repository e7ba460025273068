"""What a designer measures on a family body, exact functions of its parameters, in D."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray

ANGLES = np.linspace(0, np.pi, 181)  # from the nose to the tail


class Radii(NamedTuple):
    """Radius of curvature at the nose, at the tail, and the least one between them."""

    nose: Float[AnyArray, ""]
    tail: Float[AnyArray, ""]
    side: Float[AnyArray, ""]


def chord(parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, ""]:
    """Length along the stream."""
    return jnp.sqrt(parameters[0])


def thickness(parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, ""]:
    """Greatest thickness across the stream."""
    return 2 * jnp.max(_height(parameters, ANGLES))


def thickness_at(
    parameters: Float[AnyArray, " parameters"], station: Float[AnyArray, ""]
) -> Float[AnyArray, ""]:
    """Thickness at x/c = ``station``: 0 is the nose, 1 the tail."""
    return 2 * _height(parameters, jnp.arccos(1 - 2 * station))


def radii(parameters: Float[AnyArray, " parameters"]) -> Radii:
    """Radii of curvature of the contour, convex or hollow: |r'|^3 / |x' y'' - y' x''|."""
    half = chord(parameters) / 2
    t = ANGLES
    x1, x2 = half * np.sin(t), half * np.cos(t)
    y1, y2 = _height(parameters, t, 1), _height(parameters, t, 2)
    curvature = jnp.abs(x1 * y2 - y1 * x2) / (x1**2 + y1**2 + 1e-12) ** 1.5
    return Radii(y1[0] ** 2 / half, y1[-1] ** 2 / half, 1 / jnp.max(curvature[1:-1]))


def _height(parameters, t, derivative=0):
    """y or a derivative of it in t, half the thickness of an ellipse times the modes."""
    aspect, *betas = parameters
    turn = derivative * np.pi / 2
    modes = enumerate([1.0, *betas], start=1)
    return sum(beta * k**derivative * jnp.sin(k * t + turn) for k, beta in modes) / (
        2 * jnp.sqrt(aspect)
    )
