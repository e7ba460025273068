"""Direct optimisation, the strategy without a model: SLSQP on flows and adjoints."""

import time
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from shapeopt.payoff.slsqp import SlsqpResult, minimise_slsqp
from shapeopt.problem.constraints import BOUNDS
from shapeopt.problem.problem import Problem
from shapeopt.problem.scenarios import LOAD_BOUNDS
from shapeopt.search.design import Design, padded_loads
from shapeopt.search.evaluated import (
    EvaluatedDesign,
    evaluate_design,
    nominal_loads,
    starting_body,
)
from shapeopt.search.memory import Memory
from shapeopt.search.optimality import KKT_ACCEPTED, KKT_TOLERANCE
from surrogate.arrays import AnyArray
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.flow import Flow

ROUNDS = 4  # of SLSQP, each with a hundredth of the tolerance before


def design_directly(
    problem: Problem, flow: Flow, start: Float[AnyArray, " variables"] | None = None
) -> Design:
    """Return the optimum that SLSQP finds on the flow, from ``start`` or ``starting_body``.

    Raises:
      InvalidInput: no body satisfies the constraints.
      NotConverged: the optimality condition does not hold at the end, a flow did not converge, or
        the search came to a body that the grid does not resolve.
    """
    begin, memory = time.perf_counter(), Memory(flow, None)
    evaluated: list[EvaluatedDesign] = []

    def evaluate(variables):
        try:
            return evaluate_design(problem, memory, variables)
        except InvalidInput as reason:  # as of a body that is too thin for the grid
            raise NotConverged(f"SLSQP on the flow: {reason}") from None

    def objective(variables):
        evaluated.append(evaluate(variables))
        return evaluated[-1].value, evaluated[-1].gradient

    def load_constraints(variables):  # SciPy asks for them at the start before the objective
        found = evaluate(variables)
        return found.of_loads, found.by_loads

    body, rounds = starting_body(problem) if start is None else start, list[SlsqpResult]()
    for k in range(ROUNDS):
        tolerance = 1e-6 * 100.0**-k
        found = minimise_slsqp(objective, problem.limits, body, tolerance, load_constraints)
        rounds.append(found)
        body = rounds[-1].variables
        if rounds[-1].kkt_residual <= KKT_TOLERANCE:
            break
    best = rounds[-1]
    if not (best.feasible and best.kkt_residual <= KKT_ACCEPTED):
        raise NotConverged(
            f"SLSQP on the flow: KKT residual {best.kkt_residual:.1e} after {memory.flows} flows, "
            f"{'' if best.feasible else 'not '}within the constraints; it must be at most "
            f"{KKT_ACCEPTED:g} within them"
        )
    return Design(
        on_flow=True,
        problem=problem,
        variables=best.variables,
        objective=best.value,
        loads=padded_loads(nominal_loads(problem, memory, best.variables)),
        kkt_residual=best.kkt_residual,
        start=evaluated[0].value,
        path=problem.body(np.concatenate([found.path for found in rounds])),
        calls=0,
        flows=memory.flows,
        green_applications=memory.green_applications,
        seconds=time.perf_counter() - begin,
        derivatives=evaluate_design(problem, memory, best.variables).derivatives,  # known
    )


def nearest_design(
    problem: Problem, designs: Sequence[Design]
) -> Float[AnyArray, " variables"] | None:
    """Return the variables of the design whose problem is most similar in its bounds and log Re.

    None if there are no designs of the same variables.
    """

    def features(one):
        bounds = [getattr(one, name) or bound.usual for name, bound in BOUNDS.items()]
        bounds += [getattr(one, name) or 0.0 for name in LOAD_BOUNDS]
        return np.array([*bounds, np.log(one.objective.nominal)])

    def away(design):
        return float(np.linalg.norm(features(problem) - features(design.problem)))

    alike = [one for one in designs if one.problem.variables == problem.variables]
    return min(alike, key=away).variables if alike else None
