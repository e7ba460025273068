"""The first-order optimality (Karush-Kuhn-Tucker) residual of a body under its constraints."""

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

from shapeopt.problem.constraints import Limits, constraint_values_and_jacobian
from shapeopt.problem.scenarios import LEAST_OBJECTIVE
from surrogate.arrays import AnyArray

ACTIVE = 1e-5  # constraints, and scaled distances from the ends of ranges, below this are active
KKT_TOLERANCE = 1e-3  # residual at which a search on the flow takes a body for a local optimum
# Residual up to which its best body is accepted where no model predicts anything better: the
# discretised drag is smooth to a few digits only ("KKT at most" in the payoff tables).
KKT_ACCEPTED = 1e-2


def kkt_residual(
    limits: Limits,
    parameters: Float[AnyArray, " parameters"],
    value: float,
    gradient: Float[AnyArray, " parameters"],
    of_loads: Float[AnyArray, " constraints"] | None = None,
    by_loads: Float[AnyArray, "constraints parameters"] | None = None,
) -> float:
    """Return the KKT residual of a body: the part of the gradient that no constraint holds.

    It is equation (5) of ``shapeopt/README.md``, min over m >= 0 of |g - A^T m| / max(|f|, 0.1),
    with g the gradient of the objective f in z = (p - low) / width and A the gradients of the
    active constraints, ranges included: the relative change of f per width of a parameter's range.
    It vanishes at a local optimum. With constraints on loads it is their largest violation where
    that is larger.

    Args:
      limits: ranges of the parameters and constraints on the body.
      parameters: the body p.
      value: the objective f.
      gradient: of f in p.
      of_loads: values of the constraints on loads, >= 0 where they hold; none by default.
      by_loads: their Jacobian in p.
    """
    width = np.asarray(limits.width)
    constraints, jacobian = map(np.asarray, constraint_values_and_jacobian(parameters, limits))
    z, eye = (np.asarray(parameters) - limits.low) / width, np.eye(width.size)
    normals = [(jacobian * width)[constraints < ACTIVE], eye[z < ACTIVE], -eye[1 - z < ACTIVE]]
    violation = 0.0
    if of_loads is not None and len(of_loads):
        of_loads = np.asarray(of_loads)
        normals.append((np.asarray(by_loads) * width)[of_loads < KKT_TOLERANCE])
        violation = max(float(-of_loads.min()), 0.0)
    active, gradient = np.concatenate(normals), np.asarray(gradient) * width
    left = nnls(active.T, gradient)[1] if len(active) else float(np.linalg.norm(gradient))
    return max(float(left / max(abs(value), LEAST_OBJECTIVE)), violation)
