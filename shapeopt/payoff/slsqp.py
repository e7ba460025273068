"""Local minimisation by SciPy's SLSQP (Kraft 1988), under the constraints of a problem."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

from shapeopt.problem.constraints import FEASIBLE, Limits, constraint_values_and_jacobian
from shapeopt.search.optimality import kkt_residual
from surrogate.arrays import AnyArray

ValueAndGradient = Callable[[np.ndarray], tuple[float, np.ndarray]]
ValuesAndJacobian = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


class SlsqpResult(NamedTuple):
    """The result of a search by SLSQP.

    Attributes:
      variables: of the search, the body's parameters first, at the end.
      value: objective there.
      kkt_residual: by how much the optimality condition is missed, see ``kkt_residual``.
      feasible: whether the body satisfies the constraints, down to ``FEASIBLE``.
      path: the start, and the body after every iteration.
    """

    variables: Float[AnyArray, " variables"]
    value: float
    kkt_residual: float
    feasible: bool
    path: Float[AnyArray, "steps variables"]


def minimise_slsqp(
    value_and_gradient: ValueAndGradient,
    limits: Limits,
    start: Float[AnyArray, " variables"],
    tolerance: float = 1e-9,
    load_constraints: ValuesAndJacobian | None = None,
) -> SlsqpResult:
    """Return the local optimum that SLSQP finds from ``start``, in variables scaled to [0, 1].

    Args:
      value_and_gradient: returns the objective and its gradient at the variables.
      limits: ranges of the variables and constraints.
      start: variables of the first body.
      tolerance: SciPy's ``ftol``, of the objective.
      load_constraints: returns, at the variables, values that are >= 0 where bounds on loads
        hold, and their Jacobian in the variables.

    Returns:
      The end of the search in unscaled variables. No exception is raised where SLSQP fails; see
      ``feasible`` and ``kkt_residual``. Its own report does not count: at the optimum itself it may
      be of failure, where two drags differ by rounding alone.
    """
    low, width = limits.low, np.asarray(limits.width)
    path, last = [start], {}

    def scaled(z):
        value, gradient = value_and_gradient(low + width * z)
        last.update(z=z.copy(), gradient=gradient * width)
        return value, gradient * width

    def of_loads(z):
        none = np.zeros(0), np.zeros((0, len(low)))
        return load_constraints(low + width * z) if load_constraints else none

    def constraints(z):
        rows = [constraint_values_and_jacobian(low + width * z, limits), of_loads(z)]
        values, jacobians = (np.concatenate(part) for part in zip(*rows, strict=True))
        return values, jacobians * width

    result = minimize(
        scaled,
        np.clip((start - low) / width, 0, 1),
        jac=True,
        method="SLSQP",
        bounds=[(0, 1)] * len(low),
        constraints={
            "type": "ineq",
            "fun": lambda z: constraints(z)[0],
            "jac": lambda z: constraints(z)[1],
        },
        callback=lambda z: path.append(low + width * z),
        options={"ftol": tolerance, "maxiter": 100},
    )
    z = np.clip(result.x, 0, 1)
    value, gradient = float(result.fun), last["gradient"]
    if not np.array_equal(z, last["z"]):
        value, gradient = scaled(z)
    return SlsqpResult(
        variables=low + width * z,
        value=float(value),
        kkt_residual=kkt_residual(limits, low + width * z, value, gradient / width, *of_loads(z)),
        feasible=bool(np.all(constraints(z)[0] >= FEASIBLE)),
        path=np.array(path),
    )
