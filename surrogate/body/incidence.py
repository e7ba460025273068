"""The angle of incidence: nose up, in degrees, in a stream along +x."""

from typing import Any

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput


def rotate(markers: Float[AnyArray, "nodes 2"], degrees: float) -> Float[AnyArray, "nodes 2"]:
    """Rotate markers about the origin by ``degrees``, nose up."""
    angle = np.deg2rad(degrees)
    c, s = np.cos(angle), np.sin(angle)
    return markers @ np.array([[c, -s], [s, c]])


def check_incidence(degrees: Any) -> float:
    """Return the incidence as a float.

    Raises:
      InvalidInput: it is not a number from -180 to 180.
    """
    degrees = finite_number("incidence", degrees)
    if not abs(degrees) <= 180:
        raise InvalidInput(f"incidence {degrees:g}: from -180 to 180 degrees")
    return degrees
