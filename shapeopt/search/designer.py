"""The managed search: it ends at the flow's own optimum, whatever the model it is led by.

The model is corrected through every drag and slope that the flow has told, its optimum over the
whole family is solved, and so on until the optimality condition holds on the flow and the corrected
model promises nothing better anywhere. Alexandrov and Lewis 2001, with memory.
"""

import time
import warnings
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from shapeopt.problem.conflicts import candidates
from shapeopt.problem.objective import AtReynolds, combine
from shapeopt.problem.problem import Problem
from shapeopt.search.design import Design
from shapeopt.search.memory import Memory
from shapeopt.search.optimality import optimality
from shapeopt.search.propose import Proposal, propose
from surrogate.arrays import AnyArray
from surrogate.checks import expect
from surrogate.devices import choose_devices
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate
from surrogate.scene.scene import Scene

OPTIMAL = 1e-3  # KKT residual at which a body counts as the flow's own optimum
WIGGLE = 1e-2  # where the grid's own wiggle leaves no better, and nothing better is promised
PROMISE = 1e-4  # of the objective: less than this is not worth a flow
NEAR = 1e-3  # of a range: a body so near to a solved one would tell nothing new
MOST = 60  # bodies a design
TIGHTEST = 3  # times that a model may be told to follow the slopes more closely
LEADERS = 2  # solved bodies from which the next search starts too


class EvaluatedDesign:
    """A body whose objective the flow has told: value, gradient, optimality."""

    def __init__(self, problem: Problem, memory: Memory, parameters: np.ndarray):
        scenarios, self.parameters = problem.scenarios, parameters
        pairs = list(zip(scenarios.shift, scenarios.reynolds, strict=True))
        asked = [(parameters + shift, reynolds) for shift, reynolds in pairs]
        round_, relative = problem.scene.family.ellipse(1.0), bool(scenarios.relative)
        told = memory.ask_all(asked + [(round_, re) for _, re in pairs if relative])
        drags = np.array([flow.drag for flow in told])
        count = len(asked)
        cylinder = drags[count:] if relative else np.ones(count)
        value, weights = _combined(drags[:count], cylinder, scenarios)
        slopes = np.array([flow.drag * flow.slopes[:-1] for flow in told[:count]])
        self.value, self.gradient = float(value), np.asarray(weights) @ slopes
        self.kkt_residual = optimality(problem.limits, parameters, self.value, self.gradient)


Report = Callable[[EvaluatedDesign, int], None]


class Designer:
    """Designs of one scene, each the flow's own optimum, and every one cheaper than the last.

    Args:
      model: a surrogate to start from, or the flow alone.
      memory: file that keeps flows and adjoints; read if it is there. Several processes may share
        one: each learns at the start of a design what the others have added.
      devices: over which the cases of an objective are spread; one where nothing is said.

    Raises:
      InvalidInput: the model is none, there are not so many devices, or the file is damaged,
        foreign or of another scene.
    """

    def __init__(
        self,
        model: Surrogate | Flow,
        memory: str | Path | None = None,
        devices: int | None = None,
    ):
        check_model(model)
        flow = model if isinstance(model, Flow) else Flow(model.scene)
        base = None if isinstance(model, Flow) else model.network
        self.memory = Memory(flow, base, memory, choose_devices(devices))

    @property
    def scene(self) -> Scene:
        """Of all its designs."""
        return self.memory.flow.scene

    def design(self, problem: Problem, report: Report = lambda body, flows: None) -> Design:
        """The flow's own optimum of a problem; ``report(body, flows)`` hears of every body solved.

        Flows are kept whatever comes of the design; where they cannot be, a warning says so.

        Raises:
          InvalidInput: no body satisfies the constraints, or the problem is of another scene.
          NotConverged: no optimum was found, or a flow on the way was not.
        """
        check_problem(problem, self.scene)
        begin, memory = time.perf_counter(), self.memory
        memory.refresh()
        before = memory.flows, memory.green_applications
        try:
            solved, calls = self._search(problem, report)
        finally:
            self._keep()
        best = min(solved, key=_preference)
        if best.kkt_residual > WIGGLE:
            raise NotConverged(
                f"optimise on the flow: KKT residual {best.kkt_residual:.1e} after "
                f"{memory.flows - before[0]} flows; {OPTIMAL:g} is asked"
            )
        drag = best.value
        if not isinstance(problem.objective, AtReynolds):
            drag = memory.ask(best.parameters, problem.objective.nominal).drag
        return Design(
            problem=problem,
            parameters=best.parameters,
            objective=best.value,
            drag=drag,
            kkt_residual=best.kkt_residual,
            start=solved[0].value,
            path=np.array([body.parameters for body in solved]),
            calls=calls,
            flows=memory.flows - before[0],
            green_applications=memory.green_applications - before[1],
            seconds=time.perf_counter() - begin,
        )

    def _keep(self) -> None:
        """Put flows into the file; where that fails the design is not lost."""
        try:
            self.memory.save()
        except (OSError, InvalidInput) as problem:
            warnings.warn(f"the flows of this design were not kept: {problem}", stacklevel=3)

    def _search(self, problem: Problem, report: Report) -> tuple[list[EvaluatedDesign], int]:
        """Bodies that were solved on the way to an optimum, and drags asked of models."""
        memory, width = self.memory, np.asarray(problem.limits.width)
        solved: list[EvaluatedDesign] = []
        calls = tight = 0
        for _ in range(MOST):
            model = memory.model(tight)
            if model is None:
                body = plainest(problem)
            else:
                leaders = [body.parameters for body in sorted(solved, key=_preference)[:LEADERS]]
                proposed = propose(problem, model, leaders, settled=False)
                body, calls = proposed.parameters, calls + proposed.calls
                if finished(proposed, solved):
                    break
                if stuck(proposed, solved, width):
                    tight += 1
                    if tight > TIGHTEST:
                        break
                    continue
            solved.append(EvaluatedDesign(problem, memory, body))
            report(solved[-1], memory.flows)
        return solved, calls


def check_model(model: Surrogate | Flow) -> None:
    """Raise InvalidInput unless it is a drag model."""
    if not isinstance(model, Surrogate | Flow):
        raise InvalidInput(f"optimise: {model!r} is no drag model; load(name) or Flow(scene) is")


def check_problem(problem: Problem, scene: Scene) -> None:
    """Raise InvalidInput where it is of another scene, or over a cylinder that its family lacks."""
    expect("optimise", problem, Problem, "Problem")
    if problem.scene != scene:
        raise InvalidInput("optimise: problem and model are of different scenes")
    family = scene.family
    if bool(problem.scenarios.relative) and not family.contains(family.ellipse(1.0)):
        raise InvalidInput("weighted drags are over the cylinder's, which this family lacks")


def finished(proposed: Proposal, solved: list[EvaluatedDesign]) -> bool:
    """Whether a solved body is optimal and no other is promised to be better."""
    if not solved:
        return False
    best = min(solved, key=_preference)
    promised = 1 - proposed.value / best.value
    return best.kkt_residual <= OPTIMAL and promised < PROMISE


def stuck(proposed: Proposal, solved: list[EvaluatedDesign], width: np.ndarray) -> bool:
    """Whether the model proposes what is solved already: it takes slopes there for noise."""
    away = [np.max(np.abs(b.parameters - proposed.parameters) / width) for b in solved]
    return bool(solved and min(away) < NEAR)


def plainest(problem: Problem) -> Float[AnyArray, " parameters"]:
    """The feasible body nearest to the ellipse of aspect 2."""
    bodies, family = candidates(problem), problem.scene.family
    away = np.linalg.norm((bodies - family.ellipse(2.0)) / np.ptp(family.bounds, axis=1), axis=1)
    return bodies[np.argmin(away)]


def _preference(body: EvaluatedDesign) -> tuple[bool, float]:
    """Optimal ones first, then by value."""
    return body.kkt_residual > OPTIMAL, body.value


@jax.jit
def _combined(drags, cylinder, scenarios):
    return jax.value_and_grad(combine)(jnp.asarray(drags), cylinder, scenarios)
