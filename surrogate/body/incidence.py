"""The angle of incidence: nose up, in degrees, in a stream along +x."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Float

from surrogate.arrays import AnyArray, Number
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput


def rotate(
    vectors: Float[AnyArray, "nodes axes"], degrees: Number
) -> Float[AnyArray, "nodes axes"]:
    """Rotate points or vectors by ``degrees``, nose up, in the plane of x and the last axis.

    JAX may trace both.
    """
    angle = jnp.deg2rad(degrees)
    c, s = jnp.cos(angle), jnp.sin(angle)
    x, *width, y = jnp.moveaxis(jnp.asarray(vectors), 1, 0)
    return jnp.stack([c * x + s * y, *width, c * y - s * x], axis=1)


def check_incidence(degrees: Any) -> float:
    """Return the incidence as a float.

    Raises:
      InvalidInput: it is not a number from -180 to 180.
    """
    degrees = finite_number("incidence", degrees)
    if not abs(degrees) <= 180:
        raise InvalidInput(f"incidence {degrees:g}: from -180 to 180 degrees")
    return degrees
