"""Types of arguments: arrays of JAX or NumPy, numbers, and parameter vectors of one body."""

from collections.abc import Sequence

import jax
import numpy as np

AnyArray = jax.Array | np.ndarray
Number = float | np.number | AnyArray  # one number; an array of shape () as well
Body = Sequence[float] | AnyArray  # parameters of one body of a family, shape (parameters,)
