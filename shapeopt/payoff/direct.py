"""The rival that trains nothing: SLSQP on flows and adjoints, query by query."""

import time

import numpy as np
from jaxtyping import Float

from shapeopt.payoff.slsqp import Found, descend
from shapeopt.problem.problem import Problem
from shapeopt.search.design import Design
from shapeopt.search.designer import OPTIMAL, WIGGLE, EvaluatedDesign, plainest
from shapeopt.search.memory import Memory
from surrogate.arrays import AnyArray
from surrogate.errors import NotConverged
from surrogate.flow.flow import Flow

ROUNDS = 4  # of SLSQP, each to a hundredth of the tolerance before


def design_directly(
    problem: Problem, flow: Flow, start: Float[AnyArray, " parameters"] | None = None
) -> Design:
    """SLSQP on the flow until its optimality condition holds, from ``start`` or a plain body.

    Raises:
      InvalidInput: no body satisfies the constraints.
      NotConverged: it ended elsewhere, or a flow on the way was not found.
    """
    begin, memory = time.perf_counter(), Memory(flow, None)
    solved: list[EvaluatedDesign] = []

    def objective(parameters):
        solved.append(EvaluatedDesign(problem, memory, parameters))
        return solved[-1].value, solved[-1].gradient

    body, rounds = plainest(problem) if start is None else start, list[Found]()
    for k in range(ROUNDS):
        rounds.append(descend(objective, problem.limits, body, 1e-6 * 100.0**-k))
        body = rounds[-1].parameters
        if rounds[-1].kkt_residual <= OPTIMAL:
            break
    best = rounds[-1]
    # SLSQP that can no longer tell two drags apart reports failure at the optimum itself.
    if not (best.feasible and best.kkt_residual <= WIGGLE):
        raise NotConverged(
            f"SLSQP on the flow: KKT residual {best.kkt_residual:.1e} after {memory.flows} flows, "
            f"{'' if best.feasible else 'not '}within the constraints; {OPTIMAL:g} is asked"
        )
    return Design(
        problem=problem,
        parameters=best.parameters,
        objective=best.value,
        drag=memory.ask(best.parameters, problem.objective.nominal).drag,
        kkt_residual=best.kkt_residual,
        start=solved[0].value,
        path=np.concatenate([found.path for found in rounds]),
        calls=0,
        flows=memory.flows,
        green_applications=memory.green_applications,
        seconds=time.perf_counter() - begin,
    )


def nearest_answer(
    problem: Problem, answered: list[Design]
) -> Float[AnyArray, " parameters"] | None:
    """The answer to the most similar query before: nearest in log Re and in what is bounded."""
    if not answered:
        return None

    def away(design):
        lengths = [
            (
                a.max_length or 3.0,
                a.min_thickness or 0.3,
                a.max_thickness or 1.0,
                np.log(a.objective.nominal),
            )
            for a in (problem, design.problem)
        ]
        return float(np.linalg.norm(np.subtract(*lengths)))

    return min(answered, key=away).parameters
