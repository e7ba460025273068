"""The first-order optimality (Karush-Kuhn-Tucker) residual of a body, and its multipliers."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

from shapeopt.problem.constraints import (
    BOUNDS,
    OWN_SHAPE,
    Limits,
    constraint_names,
    constraint_values_and_jacobian,
)
from shapeopt.problem.problem import Problem
from shapeopt.problem.scenarios import LEAST_OBJECTIVE, LOAD_BOUNDS
from surrogate.arrays import AnyArray

ACTIVE = 1e-5  # constraints, and scaled distances from the ends of ranges, below this are active
KKT_TOLERANCE = 1e-3  # residual at which a search on the flow takes a body for a local optimum
# Residual up to which its best body is accepted where no model predicts anything better: the
# discretised drag is smooth to a few digits only.
KKT_ACCEPTED = 1e-2
FIXED = 1e-9  # width of a parameter's range below which it has no freedom


class Derivatives(NamedTuple):
    """What a search knows of a body to first order.

    Attributes:
      gradient: of the objective in the variables.
      of_loads: values of the constraints on loads, ``load_constraints``.
      by_loads: their Jacobian in the variables.
      drags: Cd in all scenarios.
    """

    gradient: Float[AnyArray, " variables"]
    of_loads: Float[AnyArray, " constraints"]
    by_loads: Float[AnyArray, "constraints variables"]
    drags: Float[AnyArray, " cases"]


def kkt_residual(
    limits: Limits,
    variables: Float[AnyArray, " variables"],
    value: float,
    gradient: Float[AnyArray, " variables"],
    of_loads: Float[AnyArray, " constraints"] | None = None,
    by_loads: Float[AnyArray, "constraints variables"] | None = None,
) -> float:
    """Return the KKT residual of a body: the part of the gradient that no constraint holds.

    It is equation (5) of ``shapeopt/README.md``, min over m >= 0 of |g - A^T m| / max(|f|, 0.1),
    with g the gradient of the objective f in z = (p - low) / width and A the gradients of the
    active constraints, ranges included: the relative change of f per width of a variable's range.
    It vanishes at a local optimum. With constraints on loads it is their largest violation where
    that is larger.

    Args:
      limits: ranges of the variables and constraints on the body.
      variables: the body p.
      value: the objective f.
      gradient: of f in p.
      of_loads: values of the constraints on loads, >= 0 where they hold; none by default.
      by_loads: their Jacobian in p.
    """
    if of_loads is None:
        of_loads, by_loads = np.zeros(0), np.zeros((0, len(variables)))
    _, left = _held(limits, variables, gradient, of_loads, by_loads)
    violation = float(np.max(-np.asarray(of_loads), initial=0.0))
    return max(float(left / max(abs(value), LEAST_OBJECTIVE)), violation)


def multipliers(
    problem: Problem, variables: Float[AnyArray, " variables"], found: Derivatives
) -> dict[str, float]:
    """Return the change of the optimal objective per unit of each active bound, to first order.

    They are the Lagrange multipliers m of ``kkt_residual`` in the units of the bounds: positive
    where a larger value of the bound raises the objective. Those of several active constraints of
    one bound, as of a greatest thickness at several stations, are summed. They hold at constant
    Reynolds numbers, also where the objective finds its own, as ``Settling``.

    Args:
      problem: objective and constraints.
      variables: the optimum.
      found: derivatives there.

    Returns:
      The changes by name: a field of ``Problem``, a variable's name where it is at an end of its
      range, "thickness at 0.25 c", or, where the objective has several lifts, "lift 0.3".
    """
    limits, names = problem.limits, problem.variables
    held, _ = _held(limits, variables, found.gradient, found.of_loads, found.by_loads)
    of_shape, width = constraint_names(limits), np.asarray(limits.width)
    of_load = list(LOAD_BOUNDS) if len(found.of_loads) else []
    labels = [*of_shape, *names, *names, *problem.load_bound_names]
    units = [BOUNDS[name].sense if name in BOUNDS else 1 for name in of_shape]
    units += [*(1 / width), *(-1 / width)]
    units += [LOAD_BOUNDS[name].sense / drag for name in of_load for drag in found.drags]
    fixed = {name for name, one in zip(names, width, strict=True) if one <= FIXED}
    total = dict.fromkeys(labels, 0.0)
    for label, change in zip(labels, held * units, strict=True):
        total[label] += float(change)
    return {k: x for k, x in total.items() if x and k not in (OWN_SHAPE, *fixed)}


def _held(limits, variables, gradient, of_loads, by_loads):
    """Return the multipliers of all constraints, and the norm of the gradient that none holds.

    Multipliers are of the shape, of the lower and upper ends of the ranges and of the loads, in z;
    those of inactive constraints are 0.
    """
    width = np.asarray(limits.width)
    of_shape, by_shape = map(np.asarray, constraint_values_and_jacobian(variables, limits))
    z, eye = (np.asarray(variables) - limits.low) / width, np.eye(width.size)
    active = [of_shape < ACTIVE, z < ACTIVE, 1 - z < ACTIVE, np.asarray(of_loads) < KKT_TOLERANCE]
    active = np.concatenate(active)
    normals = np.concatenate([by_shape * width, eye, -eye, np.asarray(by_loads) * width])
    found, left = np.zeros(active.size), float(np.linalg.norm(np.asarray(gradient) * width))
    if active.any():
        most = 100 * active.size  # steps of NNLS, which takes about as many as there are normals
        found[active], left = nnls(normals[active].T, np.asarray(gradient) * width, maxiter=most)
    return found, left
