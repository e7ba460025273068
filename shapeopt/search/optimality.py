"""The optimality condition of a body under its constraints, whoever found it."""

import jax
import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

from shapeopt.problem.constraints import Limits, margins
from surrogate.arrays import AnyArray

ACTIVE = 1e-5  # a constraint with less room than this counts as met with equality


def optimality(
    limits: Limits,
    parameters: Float[AnyArray, " parameters"],
    value: float,
    gradient: Float[AnyArray, " parameters"],
) -> float:
    """The KKT residual of a body from the objective's value and gradient there."""
    width = np.asarray(limits.width)
    room, jacobian = map(np.asarray, margins_and_slopes(parameters, limits))
    z = (np.asarray(parameters) - limits.low) / width
    return kkt_residual(z, value, np.asarray(gradient) * width, room, jacobian * width)


def kkt_residual(
    z: Float[np.ndarray, " parameters"],
    value: float,
    gradient: Float[np.ndarray, " parameters"],
    room: Float[np.ndarray, " constraints"],
    jacobian: Float[np.ndarray, "constraints parameters"],
) -> float:
    """What of the gradient no active constraint holds: |g - J^T m| / |f|, least over m >= 0.

    ``z`` are parameters over their ranges, so the residual is the relative change of the
    objective per range of a parameter; it vanishes at a local optimum (Karush-Kuhn-Tucker).
    """
    normals = [jacobian[room < ACTIVE], np.eye(z.size)[z < ACTIVE], -np.eye(z.size)[1 - z < ACTIVE]]
    active = np.concatenate(normals).T
    left = nnls(active, gradient)[1] if active.shape[1] else float(np.linalg.norm(gradient))
    return float(left / abs(value))


@jax.jit
def margins_and_slopes(
    parameters: Float[AnyArray, " parameters"], limits: Limits
) -> tuple[Float[AnyArray, " constraints"], Float[AnyArray, "constraints parameters"]]:
    """The constraints' margins and their derivatives in the parameters."""
    return margins(parameters, limits), jax.jacfwd(margins)(parameters, limits)
