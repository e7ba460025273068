"""Types of arguments: arrays of JAX or NumPy, numbers, and parameters of one body or many."""

from collections.abc import Sequence

import jax
import numpy as np

AnyArray = jax.Array | np.ndarray
Number = float | np.number | AnyArray  # one number; an array of shape () as well
Body = Sequence[float] | AnyArray  # parameters of one body of a family, shape (parameters,)
Numbers = Number | Sequence[float]  # one number, or an array of them
Bodies = Body | Sequence[Body]  # one body, or many in the leading axes, shape (..., parameters)
