"""Arrays of the device and of the host: functions that take either say so by this name."""

from typing import Any

import jax
import numpy as np

AnyArray = jax.Array | np.ndarray

# At the front doors anything may come in; what is no body or no number is refused there by a
# clear line, so these stand for no type.
Body = Any  # parameters of one body of the family
Number = Any  # a number of any kind
