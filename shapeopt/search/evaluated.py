"""Bodies of a search on the flow: where it starts, and what an evaluated body has."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from shapeopt.problem.conflicts import candidates
from shapeopt.problem.problem import Problem
from shapeopt.problem.scenarios import combine
from shapeopt.search.memory import Memory
from shapeopt.search.optimality import KKT_TOLERANCE, kkt_residual
from surrogate.arrays import AnyArray

Bodies = Sequence[Float[AnyArray, " parameters"]]


class EvaluatedDesign(NamedTuple):
    """A body with its objective by the flow, the gradient of it, and its KKT residual."""

    parameters: Float[AnyArray, " parameters"]
    value: float
    gradient: Float[AnyArray, " parameters"]
    kkt_residual: float

    @property
    def rank(self) -> tuple[bool, float]:
        """Sorting key: local optima first, then by objective."""
        return self.kkt_residual > KKT_TOLERANCE, self.value


def evaluate_design(
    problem: Problem, memory: Memory, parameters: Float[AnyArray, " parameters"]
) -> EvaluatedDesign:
    """Return objective, gradient and KKT residual of a body from flows and adjoints.

    Raises:
      NotConverged: a flow or adjoint did not converge.
    """
    scenarios, round_body = problem.scenarios, problem.scene.family.ellipse(1.0)
    cases = list(zip(scenarios.shift, scenarios.reynolds, strict=True))
    queries = [(parameters + shift, reynolds) for shift, reynolds in cases]
    if relative := bool(scenarios.relative):
        queries += [(round_body, reynolds) for _, reynolds in cases]
    seen, count = memory.evaluate_all(queries), len(cases)
    drags = np.array([flow.drag for flow in seen])
    round_drags = drags[count:] if relative else np.ones(count)
    value, weights = _objective_and_weights(drags[:count], round_drags, scenarios)
    slopes = np.array([flow.drag * flow.slopes[:-1] for flow in seen[:count]])  # dCd/dp
    gradient = np.asarray(weights) @ slopes
    residual = kkt_residual(problem.limits, parameters, float(value), gradient)
    return EvaluatedDesign(parameters, float(value), gradient, residual)


@jax.jit
def _objective_and_weights(drags, round_drags, scenarios):
    return jax.value_and_grad(combine)(jnp.asarray(drags), round_drags, scenarios)


def starting_body(
    problem: Problem, excluded: Bodies = (), radius: float = 0.0
) -> Float[np.ndarray, " parameters"] | None:
    """Return the feasible body nearest to the ellipse of aspect 2.

    Bodies within ``radius`` of the ``excluded`` ones (``distance``) are left out; None where no
    other is feasible.

    Raises:
      InvalidInput: no body satisfies the constraints.
    """
    bodies, family = candidates(problem), problem.scene.family
    if len(excluded):
        bodies = bodies[[distance(problem, body, excluded) > radius for body in bodies]]
    if not len(bodies):
        return None
    width = np.ptp(family.bounds, axis=1)
    return bodies[np.argmin(np.linalg.norm((bodies - family.ellipse(2.0)) / width, axis=1))]


def distance(problem: Problem, parameters: Float[AnyArray, " parameters"], bodies: Bodies) -> float:
    """Return the largest parameter difference to the nearest of some bodies, in range widths."""
    width = np.asarray(problem.limits.width)
    return min((float(np.max(np.abs(b - parameters) / width)) for b in bodies), default=np.inf)
