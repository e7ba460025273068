"""One descent from one start by SLSQP, as SciPy has it."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

from shapeopt.problem.constraints import Limits
from shapeopt.search.optimality import margins_and_slopes, optimality
from surrogate.arrays import AnyArray

ValueAndGradient = Callable[[np.ndarray], tuple[float, np.ndarray]]


class Found(NamedTuple):
    """Where SLSQP ended, whether within the constraints; ``kkt_residual`` as ``optimality``."""

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
        value, jacobian = margins_and_slopes(low + width * z, limits)
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
