"""Arrays of the device and of the host: functions that take either say so by this name."""

import jax
import numpy as np

AnyArray = jax.Array | np.ndarray
