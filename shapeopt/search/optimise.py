"""Bodies of least objective: by the surrogate, or directly by the flow's adjoint."""

import dataclasses
import time

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from shapeopt.problem.feasible import drawn_bodies
from shapeopt.problem.objective import combine
from shapeopt.problem.problem import Problem
from shapeopt.search.search import (
    STEPS,
    Found,
    descend,
    descend_together,
    predicted_and_gradient,
    ranked,
)
from shapeopt.search.verify import cylinder_drags
from surrogate.arrays import AnyArray
from surrogate.body.family import ellipse
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.flow import family_drag_and_shape_gradient
from surrogate.flow.solver.steady import preparation_cost
from surrogate.model.store import Surrogate
from surrogate.training.physics import scene_domain

STARTS = 32
OPTIMAL = 1e-3  # KKT residual at which a body counts as the flow's own optimum
ROUNDS = 4  # of SLSQP on the flow, each to a hundredth of the tolerance before


@dataclasses.dataclass(frozen=True)
class Optimum:
    """Best body found; ``drag`` is its objective, a Cd unless the objective is relative.

    ``calls`` counts drags asked for (one per scenario), ``path`` holds the bodies on the way,
    ``green_applications`` counts the flow's work: none on the surrogate. ``kkt_residual`` is of
    the model that was searched; ``start`` the objective where the search began.
    """

    parameters: Float[AnyArray, " parameters"]
    drag: float
    calls: int
    seconds: float
    converged: bool
    path: Float[AnyArray, "steps parameters"]
    kkt_residual: float
    start: float
    green_applications: int = 0


def optimise(problem: Problem, surrogate: Surrogate, finish: int = 3) -> Optimum:
    """Least predicted objective: all draws ranked, the best moved together, a few finished.

    Raises:
      InvalidInput: no body satisfies the constraints, or the surrogate is of another scene.
      NotConverged: no start reached an optimum.
    """
    if surrogate.scene != problem.scene:
        raise InvalidInput("optimisation: problem and surrogate are of different scenes")
    begin = time.perf_counter()
    network, limits, scenarios = surrogate.network, problem.limits, problem.scenarios
    feasible = problem.candidates()
    drawn = drawn_bodies(limits)
    values = np.asarray(ranked(network, drawn, limits, scenarios))
    starts = drawn[np.argsort(values)[:STARTS]]
    if np.sum(np.isfinite(values)) < STARTS:
        starts = feasible[np.arange(STARTS) % len(feasible)]
    moved, losses = map(np.asarray, descend_together(network, starts, limits, scenarios))
    best = moved[_apart(moved, losses, limits, finish)]

    def objective(parameters):
        value, gradient = predicted_and_gradient(network, parameters, scenarios)
        return float(value), np.asarray(gradient)

    results = [descend(objective, limits, body) for body in best]
    found = min(results, key=lambda found: (not found.converged, found.value))
    if not found.converged:
        raise NotConverged("optimisation: none of the starts reached an optimum")
    evaluations = len(drawn) + STARTS * (STEPS + 1) + sum(result.evaluations for result in results)
    return Optimum(
        parameters=found.parameters,
        drag=found.value,
        calls=evaluations * len(scenarios.weight),
        seconds=time.perf_counter() - begin,
        converged=True,
        path=found.path,
        kkt_residual=found.kkt_residual,
        start=objective(found.path[0])[0],
    )


def optimise_directly(
    problem: Problem, start: Float[AnyArray, " parameters"] | None = None
) -> Optimum:
    """The rival: the same search on body flows and adjoints, one of each per scenario and step.

    Starts from ``start``, or from the feasible body nearest to the ellipse of aspect 2; goes on
    until the optimality condition holds on the flow.

    Raises:
      InvalidInput, NotConverged: as ``optimise``, and where a flow on the way is not found.
    """
    begin = time.perf_counter()
    candidates = problem.candidates()
    if start is None:
        start = candidates[np.argmin(_distance_from_start(problem, candidates))]
    flow = _FlowObjective(problem)
    rounds: list[Found] = []
    for k in range(ROUNDS):
        rounds.append(descend(flow, problem.limits, start, 1e-6 * 100.0**-k))
        start = rounds[-1].parameters
        if rounds[-1].kkt_residual <= OPTIMAL:
            break
    best = rounds[-1]
    # SLSQP that can no longer tell two drags apart reports failure at the optimum itself.
    if not (best.feasible and np.isfinite(best.value) and best.kkt_residual <= OPTIMAL):
        raise NotConverged(
            f"direct optimisation: KKT residual {best.kkt_residual:.1e} after {flow.flows} flows, "
            f"{'' if best.feasible else 'not '}within the constraints; {OPTIMAL:g} is asked"
        )
    return Optimum(
        parameters=best.parameters,
        drag=best.value,
        calls=flow.flows,
        seconds=time.perf_counter() - begin,
        converged=True,
        path=np.concatenate([found.path for found in rounds]),
        kkt_residual=best.kkt_residual,
        start=flow.first,
        green_applications=flow.green_applications,
    )


class _FlowObjective:
    """The objective by body flows, with its gradient; counts the flows and their work."""

    def __init__(self, problem: Problem):
        self.domain, self.scenarios = scene_domain(problem.scene), problem.scenarios
        relative = bool(self.scenarios.relative)
        self.cylinder = cylinder_drags(problem) if relative else np.ones(len(self.scenarios.weight))
        self.flows, self.green_applications, self.first = 0, 0, float("nan")

    def __call__(self, parameters: np.ndarray) -> tuple[float, np.ndarray]:
        drags, slopes = [], []
        for shift, reynolds in zip(self.scenarios.shift, self.scenarios.reynolds, strict=True):
            drag, slope, info = family_drag_and_shape_gradient(
                self.domain, jnp.asarray(parameters + shift), jnp.asarray(reynolds)
            )
            if not (bool(info.converged) and np.all(np.isfinite(slope))):
                raise NotConverged(f"direct optimisation: no flow at Re {reynolds:g}")
            self.flows += 1
            self.green_applications += int(info.products) + preparation_cost(self.domain)
            drags.append(float(drag))
            slopes.append(np.asarray(slope))
        value, weights = _combined(np.array(drags), self.cylinder, self.scenarios)
        if np.isnan(self.first):
            self.first = float(value)
        return float(value), np.asarray(weights) @ np.array(slopes)


def _apart(bodies, losses, limits, count):
    """Indices of the best bodies that differ from each other."""
    width = np.maximum(limits.high - limits.low, 1e-12)
    chosen: list[int] = []
    for k in np.argsort(losses):
        if all(np.max(np.abs(bodies[k] - bodies[j]) / width) > 0.02 for j in chosen):
            chosen.append(int(k))
        if len(chosen) == count:
            break
    return chosen


def _distance_from_start(problem, candidates):
    """How far a body is from a plain ellipse of aspect 2."""
    low, high = problem.scene.family.bounds.T
    return np.linalg.norm((candidates - ellipse(2.0)) / (high - low), axis=1)


@jax.jit
def _combined(drags, cylinder, scenarios):
    return jax.value_and_grad(combine)(drags, cylinder, scenarios)
