"""Values on a wall from the flow outside of the smeared layer: probes and interpolation."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray

# Cells off the wall at which a field is probed and from which it is extrapolated to the wall.
# Vorticity is probed clear of the smeared force (two cells), where it is smooth; pressure, which is
# smoother, from 1.5 cells (study ``constants``).
VORTICITY_PROBES = (2.5, 3.5, 4.5)
PRESSURE_PROBES = (1.5, 2.5, 3.5)


def extrapolation_weights(distances: tuple[float, ...]) -> Float[np.ndarray, " probes"]:
    """Return the weights that extrapolate values at these distances to distance 0."""
    return np.linalg.solve(np.vander(distances, increasing=True).T, np.eye(len(distances))[0])


def keys_weights(r: Float[AnyArray, "..."]) -> Float[Array, "..."]:
    """Return the weights of cubic convolution (Keys 1981) for values at distances r, in cells."""
    a = jnp.abs(r)
    near = 1 + a**2 * (1.5 * a - 2.5)
    far = 2 + a * (-4 + a * (2.5 - 0.5 * a))
    return jnp.where(a < 1, near, jnp.where(a < 2, far, 0.0))
