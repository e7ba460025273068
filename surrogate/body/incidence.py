"""The angle of incidence: nose up, in degrees, in a stream along +x."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray, Number, array_module
from surrogate.body.parameters import HALF_TURN, INCIDENCE, QUARTER_TURN, Parameter
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput


def rotate(
    vectors: Float[AnyArray, "nodes axes"], degrees: Number
) -> Float[AnyArray, "nodes axes"]:
    """Rotate points or vectors by ``degrees``, nose up, in the plane of x and the last axis.

    JAX may trace both. NumPy rotates NumPy's arrays, for which JAX would compile for every number
    of nodes.
    """
    xp = array_module(vectors, degrees)
    angle = xp.deg2rad(degrees)
    c, s = xp.cos(angle), xp.sin(angle)
    x, *width, y = xp.moveaxis(vectors, 1, 0)
    return xp.stack([c * x + s * y, *width, c * y - s * x], axis=1)


def check_incidence(degrees: object) -> float:
    """Check an incidence in degrees and return it as a float.

    Raises:
      InvalidInput: it is not a number from -180 to 180.
    """
    degrees = finite_number("incidence", degrees)
    if not abs(degrees) <= 180:
        raise InvalidInput(f"incidence {degrees:g}: from -180 to 180 degrees")
    return degrees


def in_first_quarter(
    parameters: tuple[Parameter, ...], values: Float[AnyArray, " parameters"]
) -> tuple[Float[Array, " parameters"], Float[Array, ""]]:
    """Describe a 3-D body at any incidence by parameters with an incidence from 0 to 90 degrees.

    A body is the same if nose and tail change their names, which negates its even sine modes and
    adds 180 degrees; its mirror image at the opposite incidence has opposite lift and moment.

    Args:
      parameters: of the body's class, one of which is the incidence.
      values: of these.

    Returns:
      The values with an incidence from 0 to 90, and 1; or -1 where they describe the mirror image.
    """
    index = [p.name for p in parameters].index(INCIDENCE.name)
    values = jnp.asarray(values)
    angle = jnp.mod(values[index] + HALF_TURN, 2 * HALF_TURN) - HALF_TURN
    backward = jnp.abs(angle) > QUARTER_TURN
    values = jnp.where(backward, reversal(parameters) * values, values)
    nearest = jnp.where(backward, HALF_TURN - jnp.abs(angle), jnp.abs(angle))
    image = jnp.where((angle < 0) ^ backward, -1.0, 1.0)
    return values.at[index].set(nearest), image


def reversal(parameters: tuple[Parameter, ...]) -> Float[np.ndarray, " parameters"]:
    """Return the factors of parameters that exchange nose and tail: -1 for even sine modes.

    Args:
      parameters: of the body's class.
    """
    return np.array([-1.0 if p.odd_fore_and_aft else 1.0 for p in parameters])


def descriptions(
    parameters: tuple[Parameter, ...], dimension: int
) -> tuple[Float[np.ndarray, "rows parameters"], Float[np.ndarray, "rows parameters"]]:
    """Return all descriptions of a body, or of its mirror image in the same stream.

    They are ``signs * values + offsets``, the body's own values among them. Camber and incidence
    change their signs in the mirror image; in 3-D, where nose and tail change their names, the even
    sine modes do, and the incidence a becomes 180 - a or 180 + a. Cd is the same, and Cl and Cm are
    up to their signs.

    Args:
      parameters: of the body's class.
      dimension: 2 or 3.

    Returns:
      The signs and the offsets, a row for each description.
    """
    mirror = np.array([1.0 if p.keeps_mirror_plane else -1.0 for p in parameters])
    incidence = np.array([p.name == INCIDENCE.name for p in parameters])
    signs, offsets = [np.ones(len(parameters)), mirror], [0.0, 0.0]
    if dimension == 3:
        reverse = reversal(parameters)
        signs += [reverse, reverse * mirror]
        offsets += [HALF_TURN, HALF_TURN]
    return np.array(signs), np.outer(offsets, incidence)
