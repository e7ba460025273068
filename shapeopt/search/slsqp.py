"""One descent from one start by SLSQP, and the optimality condition at its end."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize, nnls

from shapeopt.problem.constraints import Limits, margins
from surrogate.arrays import AnyArray

ACTIVE = 1e-5  # a constraint with less room than this counts as met with equality

ValueAndGradient = Callable[[np.ndarray], tuple[float, np.ndarray]]


class Found(NamedTuple):
    """Where SLSQP ended, whether within the constraints; ``kkt_residual`` as the function."""

    parameters: Float[AnyArray, " parameters"]
    value: float
    evaluations: int
    kkt_residual: float
    feasible: bool
    converged: bool
    path: Float[AnyArray, "steps parameters"]


def descend(
    value_and_gradient: ValueAndGradient,
    limits: Limits,
    start: Float[AnyArray, " parameters"],
    tolerance: float = 1e-9,
) -> Found:
    """SLSQP (Kraft 1988) in parameters scaled to [0, 1]."""
    low, width = limits.low, np.asarray(limits.width)
    path, last = [start], {}

    def scaled(z):
        value, gradient = value_and_gradient(low + width * z)
        last.update(z=z.copy(), gradient=gradient * width, calls=last.get("calls", 0) + 1)
        return value, gradient * width

    def room(z):
        value, jacobian = _margins(low + width * z, limits)
        return np.asarray(value), np.asarray(jacobian) * width

    result = minimize(
        scaled,
        np.clip((start - low) / width, 0, 1),
        jac=True,
        method="SLSQP",
        bounds=[(0, 1)] * len(low),
        constraints={
            "type": "ineq",
            "fun": lambda z: room(z)[0],
            "jac": lambda z: room(z)[1],
        },
        callback=lambda z: path.append(low + width * z),
        options={"ftol": tolerance, "maxiter": 100},
    )
    z = np.clip(result.x, 0, 1)
    value, gradient = float(result.fun), last["gradient"]
    if not np.array_equal(z, last["z"]):
        value, gradient = scaled(z)
    feasible = bool(np.all(room(z)[0] >= -1e-6))
    return Found(
        parameters=low + width * z,
        value=float(value),
        evaluations=last["calls"],
        kkt_residual=optimality(limits, low + width * z, value, gradient / width),
        feasible=feasible,
        converged=bool(result.success) and feasible and bool(np.isfinite(value)),
        path=np.array(path),
    )


def optimality(
    limits: Limits,
    parameters: Float[AnyArray, " parameters"],
    value: float,
    gradient: Float[AnyArray, " parameters"],
) -> float:
    """The KKT residual of a body from the objective's value and gradient there."""
    width = np.asarray(limits.width)
    room, jacobian = map(np.asarray, _margins(parameters, limits))
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
def _margins(parameters, limits):
    return margins(parameters, limits), jax.jacfwd(margins)(parameters, limits)
