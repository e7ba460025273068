"""Types of arguments: arrays of JAX or NumPy, numbers, and parameters of one body or many."""

from collections.abc import Mapping, Sequence

import jax
import numpy as np

AnyArray = jax.Array | np.ndarray
Number = float | np.number | AnyArray  # one number; an array of shape () as well
# Parameters of one body of a family, shape (parameters,), or a table of them by name.
Body = Sequence[float] | AnyArray | Mapping[str, Number]
Numbers = Number | Sequence[float]  # one number, or an array of them
Bodies = Body | Sequence[Body]  # one body, or many in the leading axes, shape (..., parameters)
