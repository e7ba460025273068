"""The body that a drag model finds best: draws ranked, the best moved together, some finished."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from shapeopt.problem.conflicts import candidates
from shapeopt.problem.feasible import drawn_bodies
from shapeopt.problem.problem import Problem
from shapeopt.search.slsqp import Found, descend
from shapeopt.search.together import STEPS, descend_together, predicted_and_gradient, ranked
from surrogate.arrays import AnyArray
from surrogate.errors import NotConverged

RANKED = 1024  # draws
STARTS = 16
FINISHED = 4  # of them, by SLSQP; more where there are more than four parameters


class Proposal(NamedTuple):
    """Where the search on a model ended, the objective where it began, drags asked of the model."""

    found: Found
    start: float
    calls: int


def propose(
    problem: Problem, model: Any, leaders: Sequence[Float[AnyArray, " parameters"]] = ()
) -> Proposal:
    """The global optimum of the problem on a differentiable model; ``leaders`` are starts too.

    Raises:
      InvalidInput: no body satisfies the constraints.
      NotConverged: no start reached an optimum.
    """
    limits, scenarios = problem.limits, problem.scenarios
    drawn = drawn_bodies(limits)[:RANKED]
    values = np.asarray(ranked(model, drawn, limits, scenarios))
    starts = drawn[np.argsort(values)[:STARTS]]
    if np.sum(np.isfinite(values)) < STARTS:
        feasible = candidates(problem)
        starts = feasible[np.arange(STARTS) % len(feasible)]
    if leaders:
        starts = np.concatenate([starts[: STARTS - len(leaders)], np.array(leaders)])
    moved, losses = map(np.asarray, descend_together(model, starts, limits, scenarios))
    best = moved[_apart(moved, losses, np.asarray(limits.width))]

    def objective(parameters):
        value, gradient = predicted_and_gradient(model, parameters, scenarios)
        return float(value), np.asarray(gradient)

    results = [descend(objective, limits, body) for body in best]
    found = min(results, key=lambda found: (not found.converged, found.value))
    if not found.converged:
        raise NotConverged("optimise: none of the starts reached an optimum")
    evaluations = len(drawn) + STARTS * (STEPS + 1) + sum(result.evaluations for result in results)
    return Proposal(found, objective(found.path[0])[0], evaluations * len(scenarios.weight))


def _apart(bodies, losses, width):
    """Indices of the best bodies that differ from each other."""
    chosen: list[int] = []
    for k in np.argsort(losses):
        if all(np.max(np.abs(bodies[k] - bodies[j]) / width) > 0.02 for j in chosen):
            chosen.append(int(k))
        if len(chosen) == max(FINISHED, 2 * len(width) - 4):
            break
    return chosen
