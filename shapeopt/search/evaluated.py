"""Bodies of a search on the flow: where it starts, and what an evaluated body has."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from shapeopt.problem.conflicts import candidates
from shapeopt.problem.constraints import FEASIBLE, satisfied
from shapeopt.problem.problem import Problem
from shapeopt.problem.scenarios import combine, load_constraints
from shapeopt.search.memory import Memory
from shapeopt.search.optimality import KKT_ACCEPTED, KKT_TOLERANCE, Derivatives, kkt_residual
from surrogate.arrays import AnyArray

Bodies = Sequence[Float[AnyArray, " variables"]]


class EvaluatedDesign(NamedTuple):
    """A body with its objective by the flow, the gradient of it, and its KKT residual.

    ``variables`` are those of the search, the body's parameters first; ``of_loads`` are the values
    of its load constraints by the flow, ``by_loads`` their Jacobian, ``drags`` Cd in all scenarios.
    """

    variables: Float[AnyArray, " variables"]
    value: float
    gradient: Float[AnyArray, " variables"]
    kkt_residual: float
    of_loads: Float[AnyArray, " constraints"]
    by_loads: Float[AnyArray, "constraints variables"]
    drags: Float[AnyArray, " cases"]

    @property
    def derivatives(self) -> Derivatives:
        """What is known of the body to first order."""
        return Derivatives(self.gradient, self.of_loads, self.by_loads, self.drags)

    @property
    def rank(self) -> tuple[bool, float]:
        """The key by which evaluated bodies are sorted: local optima first, then by objective."""
        return self.kkt_residual > KKT_TOLERANCE, self.value


def best_design(evaluated: Sequence[EvaluatedDesign]) -> EvaluatedDesign:
    """Return the best body by its rank, of those that are accepted as optima if there are any."""
    return min(evaluated, key=lambda body: (body.kkt_residual > KKT_ACCEPTED, *body.rank))


def evaluate_design(
    problem: Problem, memory: Memory, variables: Float[AnyArray, " variables"]
) -> EvaluatedDesign:
    """Return objective, gradient and KKT residual of a body, from flows and adjoints.

    Raises:
      InvalidInput: the scene's grid does not resolve the body.
      NotConverged: a flow or adjoint did not converge.
    """
    scenarios, round_body = problem.scenarios, problem.scene.family.ellipse(1.0)
    reference, count = problem.reference, len(scenarios.weight)
    bodies, reynolds = list(scenarios.bodies(variables)), list(scenarios.reynolds)
    if relative := bool(scenarios.relative):
        bodies, reynolds = bodies + [round_body] * count, reynolds * 2
    seen = memory.evaluate_all(list(map(reference.query, bodies, reynolds)))
    loads = np.array([reference.loads(flow.parameters, flow.loads) for flow in seen])
    round_drags = loads[count:, 0] if relative else np.ones(count)
    (value, constraints), weights = _values_and_weights(loads[:count], round_drags, scenarios)
    inputs = [(flow.parameters, flow.loads, flow.load_slopes) for flow in seen[:count]]
    slopes = np.array([reference.slopes(*one)[:, :-1] for one in inputs])  # d loads / dp
    slopes = scenarios.by_variables(slopes, len(variables))
    gradient, by_loads = (np.tensordot(w, slopes, axes=2) for w in weights)
    value, of_loads = float(value), np.asarray(constraints)
    residual = kkt_residual(problem.limits, variables, value, gradient, of_loads, by_loads)
    drags = loads[:count, 0]
    return EvaluatedDesign(variables, value, gradient, residual, of_loads, by_loads, drags)


def nominal_loads(
    problem: Problem, memory: Memory, variables: Float[AnyArray, " variables"]
) -> Float[AnyArray, " loads"]:
    """Return the loads of a body at the nominal Re of a problem, by its reference length.

    Raises:
      NotConverged: the flow or its adjoint did not converge.
    """
    body = problem.body(variables)
    query = problem.reference.query(body, problem.objective.nominal)
    return problem.reference.loads(body, memory.evaluate(*query).loads)


def known_optima(problem: Problem, memory: Memory) -> list[EvaluatedDesign]:
    """Return the bodies of the memory that are optima of a problem, without solving any flow.

    There are none where one flow does not answer it: with several scenarios, or relative drags.
    """
    scenarios = problem.scenarios
    if len(scenarios.weight) > 1 or bool(scenarios.relative):
        return []
    at = scenarios.reynolds[0]
    seen = ((one.parameters, one.reynolds) for one in memory.observations)
    bodies = [p for p, reynolds in seen if problem.reference.query(p, at)[1] == reynolds]
    bodies = [p for p in bodies if satisfied(p[None], problem.limits, -FEASIBLE)[0]]
    known = (evaluate_design(problem, memory, body) for body in bodies)
    return [one for one in known if one.kkt_residual <= KKT_TOLERANCE]


@jax.jit
def _values_and_weights(loads, round_drags, scenarios):
    """Return objective and load constraints of all cases, and their derivatives in the loads."""

    def values(loads):
        return combine(loads, round_drags, scenarios), load_constraints(loads, scenarios)

    return values(loads), jax.jacrev(values)(loads)


def starting_body(
    problem: Problem, excluded: Bodies = (), radius: float = 0.0
) -> Float[np.ndarray, " variables"] | None:
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
    away = bodies[:, problem.scenarios.variable] - family.ellipse(2.0)  # in all cases
    return bodies[np.argmin(np.linalg.norm(away / np.ptp(family.bounds, axis=1), axis=(1, 2)))]


def distance(problem: Problem, variables: Float[AnyArray, " variables"], bodies: Bodies) -> float:
    """Return the distance of a body from the nearest of ``bodies``, in widths of the ranges.

    It is the largest difference of a variable; infinity if there are no bodies.
    """
    width = np.asarray(problem.limits.width)
    return min((float(np.max(np.abs(b - variables) / width)) for b in bodies), default=np.inf)
