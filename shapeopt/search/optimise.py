"""The body of least objective: by a surrogate, or by the flow and its adjoint."""

import dataclasses
import time
from typing import Any

import numpy as np
from jaxtyping import Float

from shapeopt.problem.conflicts import candidates
from shapeopt.problem.feasible import drawn_bodies
from shapeopt.problem.objective import AtReynolds
from shapeopt.problem.problem import Problem
from shapeopt.search.flow_objective import FlowObjective
from shapeopt.search.slsqp import Found, descend
from shapeopt.search.together import STEPS, descend_together, predicted_and_gradient, ranked
from surrogate.arrays import AnyArray
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate

STARTS = 32
FINISHED = 3  # of them, by SLSQP
OPTIMAL = 1e-3  # KKT residual at which a body counts as the flow's own optimum
ROUNDS = 4  # of SLSQP on the flow, each to a hundredth of the tolerance before


@dataclasses.dataclass(frozen=True)
class Design:
    """The best body found, its objective, and its Cd at the nominal Reynolds number.

    Both are of the model that was searched last, and so is ``kkt_residual``; ``start`` is the
    objective where that search began. ``calls`` counts drags asked of the surrogate, ``flows``
    those of the flow (one per scenario and step), ``green_applications`` their work with that of
    the adjoints. ``path`` holds the bodies on the way.
    """

    parameters: Float[AnyArray, " parameters"]
    objective: float
    drag: float
    kkt_residual: float
    start: float
    path: Float[AnyArray, "steps parameters"]
    calls: int
    flows: int
    green_applications: int
    seconds: float


def optimise(
    problem: Problem,
    model: Surrogate | Flow | Any,
    until: str = "surrogate",
    start: Float[AnyArray, " parameters"] | None = None,
) -> Design:
    """Minimise the problem's objective over the family, within its constraints.

    Args:
      problem: what is asked.
      model: a surrogate of the problem's scene, or its flow.
      until: with a surrogate, whether its own optimum is the end, or the ``flow``'s, which is then
        sought from there by the flow's adjoint.
      start: of a search on the flow; the feasible body nearest to the ellipse of aspect 2 if None.

    Raises:
      InvalidInput: no body satisfies the constraints, or the model is of another scene.
      NotConverged: no start reached an optimum, or a flow on the way was not found.
    """
    if not isinstance(model, Surrogate | Flow):
        raise InvalidInput(f"optimise: {model!r} is no drag model; load(name) or Flow(scene) is")
    if model.scene != problem.scene:
        raise InvalidInput("optimise: problem and model are of different scenes")
    if until not in ("surrogate", "flow"):
        raise InvalidInput(f"until {until!r}: 'surrogate' or 'flow'")
    if isinstance(model, Flow):
        return _by_flow(problem, model, start)
    proposed = _by_surrogate(problem, model)
    if until == "surrogate":
        return proposed
    design = _by_flow(problem, Flow(problem.scene), proposed.parameters)
    return dataclasses.replace(
        design,
        calls=proposed.calls,
        seconds=proposed.seconds + design.seconds,
        path=np.concatenate([proposed.path, design.path]),
    )


def _by_surrogate(problem: Problem, surrogate: Surrogate) -> Design:
    """All draws ranked, the best moved together, a few finished."""
    begin = time.perf_counter()
    network, limits, scenarios = surrogate.network, problem.limits, problem.scenarios
    family = problem.scene.family
    if bool(scenarios.relative) and not family.contains(family.ellipse(1.0)):
        raise InvalidInput("weighted drags are over the cylinder's, which this family lacks")
    feasible = candidates(problem)
    drawn = drawn_bodies(limits)
    values = np.asarray(ranked(network, drawn, limits, scenarios))
    starts = drawn[np.argsort(values)[:STARTS]]
    if np.sum(np.isfinite(values)) < STARTS:
        starts = feasible[np.arange(STARTS) % len(feasible)]
    moved, losses = map(np.asarray, descend_together(network, starts, limits, scenarios))
    best = moved[_apart(moved, losses, np.asarray(limits.width))]

    def objective(parameters):
        value, gradient = predicted_and_gradient(network, parameters, scenarios)
        return float(value), np.asarray(gradient)

    results = [descend(objective, limits, body) for body in best]
    found = min(results, key=lambda found: (not found.converged, found.value))
    if not found.converged:
        raise NotConverged("optimise: none of the starts reached an optimum")
    evaluations = len(drawn) + STARTS * (STEPS + 1) + sum(result.evaluations for result in results)
    return _design(
        problem,
        surrogate,
        found,
        start=objective(found.path[0])[0],
        path=found.path,
        calls=evaluations * len(scenarios.weight),
        flows=0,
        green_applications=0,
        seconds=time.perf_counter() - begin,
    )


def _by_flow(problem: Problem, flow: Flow, start: AnyArray | None) -> Design:
    """SLSQP on flows and adjoints until the optimality condition holds on the flow."""
    begin = time.perf_counter()
    feasible = candidates(problem)
    if start is None:
        width = np.ptp(problem.scene.family.bounds, axis=1)
        away = np.linalg.norm((feasible - problem.scene.family.ellipse(2.0)) / width, axis=1)
        start = feasible[np.argmin(away)]
    objective = FlowObjective(problem, flow)
    rounds: list[Found] = []
    for k in range(ROUNDS):
        rounds.append(descend(objective, problem.limits, start, 1e-6 * 100.0**-k))
        start = rounds[-1].parameters
        if rounds[-1].kkt_residual <= OPTIMAL:
            break
    best = rounds[-1]
    # SLSQP that can no longer tell two drags apart reports failure at the optimum itself.
    if not (best.feasible and np.isfinite(best.value) and best.kkt_residual <= OPTIMAL):
        raise NotConverged(
            f"optimise on the flow: KKT residual {best.kkt_residual:.1e} after {objective.flows} "
            f"flows, {'' if best.feasible else 'not '}within the constraints; {OPTIMAL:g} is asked"
        )
    return _design(
        problem,
        flow,
        best,
        start=objective.first,
        path=np.concatenate([found.path for found in rounds]),
        calls=0,
        flows=objective.flows,
        green_applications=objective.green_applications,
        seconds=time.perf_counter() - begin,
    )


def _design(problem: Problem, model: Surrogate | Flow, found: Found, **rest: Any) -> Design:
    drag = found.value
    if not isinstance(problem.objective, AtReynolds):
        drag = float(model.drag(found.parameters, problem.objective.nominal))
    return Design(
        parameters=found.parameters,
        objective=found.value,
        drag=drag,
        kkt_residual=found.kkt_residual,
        **rest,
    )


def _apart(bodies, losses, width):
    """Indices of the best bodies that differ from each other."""
    chosen: list[int] = []
    for k in np.argsort(losses):
        if all(np.max(np.abs(bodies[k] - bodies[j]) / width) > 0.02 for j in chosen):
            chosen.append(int(k))
        if len(chosen) == FINISHED:
            break
    return chosen
