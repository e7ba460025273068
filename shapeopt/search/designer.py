"""The managed search: it ends at an optimum of the flow, whatever model leads it there.

Model management after Alexandrov and Lewis (2001), with kriging as the correction. In each
iteration the model is corrected by kriging through all observations of the flow, its global optimum
is computed, and flow and adjoints are solved there. It ends where the optimality condition holds on
the flow and the corrected model predicts nothing better. See ``shapeopt/README.md``, section 3.
"""

import contextlib
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from shapeopt.problem.constraints import FEASIBLE, satisfied
from shapeopt.problem.problem import Problem
from shapeopt.problem.scenarios import LEAST_OBJECTIVE, LoadModel
from shapeopt.search.design import Design, padded_loads
from shapeopt.search.evaluated import (
    Bodies,
    EvaluatedDesign,
    best_design,
    distance,
    evaluate_design,
    known_optima,
    nominal_loads,
    starting_body,
)
from shapeopt.search.following import MAX_PROBLEMS, follow_all, following, not_followed
from shapeopt.search.memory import Memory
from shapeopt.search.optimality import KKT_ACCEPTED, KKT_TOLERANCE
from shapeopt.search.propose import Proposal, propose
from surrogate.checks import expect
from surrogate.devices import choose_devices
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate
from surrogate.repeats import differences
from surrogate.scene.scene import Scene

DECREASE = 1e-4  # predicted relative decrease of the objective that is worth a flow
NEAR = 1e-3  # distance, in range widths, below which two bodies count as the same
MAX_ITERATIONS = 60  # of the search of one problem
MAX_TIGHTNESS = 3  # of the model, see ``Memory.model``
STARTS = 2  # best evaluated bodies from which the search on the model starts too
# Where flows or proposals fail: failures of a design, halvings of the step to a body that failed,
# and the distance that a new start keeps from bodies that failed.
MAX_FAILURES, HALVINGS, CLEARANCE = 10, 6, 0.1

Report = Callable[[EvaluatedDesign, int], None]


class Designer:
    """A search for optima of the flow of one scene, which reuses its flows from design to design.

    Args:
      model: a surrogate that leads the search, or the flow to start from nothing.
      memory: JSON file that keeps flows and adjoints; it is read if it exists. Several processes
        may share one: each reads at the start of a design what the others have added.
      devices: number of devices that the scenarios of an objective are spread over (1).

    Raises:
      InvalidInput: ``model`` is no drag model, there are fewer devices, or the file is damaged, of
        another program or of another scene.
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
        """The scene of all designs."""
        return self.memory.flow.scene

    def design(self, problem: Problem, report: Report | None = None) -> Design:
        """Return an optimum of the flow for a problem.

        Flows are kept whether or not the search succeeds; a warning says where they could not be
        written to the file. A body whose flow does not converge, or that is too thin for the
        scene's grid, is left out.

        Args:
          problem: of the designer's scene.
          report: called as ``report(body, flows)`` after each body, an ``EvaluatedDesign``, with
            the number of flows so far.

        Raises:
          InvalidInput: no body satisfies the constraints, or the problem is of another scene.
          NotConverged: no optimum was found.
        """
        check_problem(problem, self.scene)
        begin, memory = time.perf_counter(), self.memory
        memory.refresh()
        before = memory.flows, memory.green_applications
        try:
            problem, evaluated, failures, calls = self._follow(problem, report)
            best = best_design(evaluated)
            loads = self._nominal_loads(problem, best)
        finally:
            self._save()
        if best.kkt_residual > KKT_ACCEPTED:
            lost = f" and {failures} that were not found" if failures else ""
            raise NotConverged(
                f"optimise on the flow: KKT residual {best.kkt_residual:.1e} after "
                f"{memory.flows - before[0]} flows{lost}; it must be at most {KKT_ACCEPTED:g}"
            )
        return Design(
            problem=problem,
            variables=best.variables,
            objective=best.value,
            loads=padded_loads(loads),
            kkt_residual=best.kkt_residual,
            start=evaluated[0].value,
            path=problem.body(np.array(_variables(evaluated))),
            calls=calls,
            flows=memory.flows - before[0],
            green_applications=memory.green_applications - before[1],
            seconds=time.perf_counter() - begin,
            derivatives=best.derivatives,
            on_flow=True,
        )

    def _nominal_loads(self, problem, best):
        """Return the loads at the nominal Re, known already if it is a case; NaN if not found."""
        if best.kkt_residual <= KKT_ACCEPTED:
            with contextlib.suppress(InvalidInput, NotConverged):
                return nominal_loads(problem, self.memory, best.variables)
        return np.full(len(self.memory.flow.bodies.loads), np.nan)

    def _save(self) -> None:
        """Write flows to the file; where that fails the design is still returned."""
        try:
            self.memory.save()
        except (OSError, InvalidInput) as problem:
            warnings.warn(f"the flows of this design were not kept: {problem}", stacklevel=3)

    def _follow(
        self, problem: Problem, report: Report | None
    ) -> tuple[Problem, list[EvaluatedDesign], int, int]:
        """Return the last problem that follows from a problem, and the results of its search.

        Raises:
          InvalidInput: there is no answer within the scene.
          NotConverged: no flow was found, or no last problem.
        """
        memory, failures, calls = self.memory, 0, 0
        if not problem.objective.fixed and memory.base is not None:
            with contextlib.suppress(InvalidInput, NotConverged):  # the flow may have an answer
                (problem,), (proposal,) = follow_all([problem], memory.base)
                calls = proposal.calls
        for _ in range(MAX_PROBLEMS):
            evaluated, failed, evaluations = self._search(problem, report)
            failures, calls = failures + failed, calls + evaluations
            if problem.objective.fixed:
                return problem, evaluated, failures, calls
            best = best_design(evaluated)
            seen = memory.evaluate(best.variables, problem.scenarios.reynolds[0])
            found = following(problem, seen.loads, seen.load_slopes[:, -1])
            if found is None:
                return problem, evaluated, failures, calls
            problem = found
        raise not_followed()

    def _search(
        self, problem: Problem, report: Report | None
    ) -> tuple[list[EvaluatedDesign], int, int]:
        """Return the evaluated bodies, the number of failed ones, and that of drags of models.

        Raises:
          NotConverged: no flow was found, or none of the last ``MAX_FAILURES`` models has an
            optimum, as where bounds on loads are out of reach.
        """
        memory, failed, refusal = self.memory, list[np.ndarray](), ""
        evaluated = known_optima(problem, memory)
        calls = tightness = without = 0
        for _ in range(MAX_ITERATIONS):
            try:
                proposal = _propose(problem, memory.model(tightness), evaluated)
            except NotConverged:
                proposal, without = None, without + 1
                if without == MAX_FAILURES:
                    if _accepted(evaluated):
                        break
                    raise
            if proposal is not None:
                calls, without = calls + proposal.calls, 0
                if _finished(proposal, evaluated):
                    break
                if distance(problem, proposal.variables, _variables(evaluated)) < NEAR:
                    tightness += 1  # the model takes the gradient there for noise
                    if tightness > MAX_TIGHTNESS:
                        break
                    continue
            body = _next_body(problem, proposal, evaluated, failed)
            if body is None:
                break
            try:
                evaluated.append(evaluate_design(problem, memory, body))
            except (InvalidInput, NotConverged) as reason:
                if isinstance(reason, InvalidInput):  # as where it is too thin for the grid
                    refusal = f"; {reason}"
                failed.append(body)
                if len(failed) == MAX_FAILURES:
                    break
                continue
            if report:
                report(evaluated[-1], memory.flows)
        if not evaluated:
            number = f"{'chord ' * problem.by_chord}Re {problem.objective.nominal:g}"
            where = f"any of {len(failed)} bodies about {number}"
            raise NotConverged(f"optimise on the flow: no flow or adjoint of {where}{refusal}")
        return evaluated, len(failed), calls


def check_model(model: Surrogate | Flow) -> None:
    """Raise InvalidInput unless the model is a ``Surrogate`` or a ``Flow``."""
    if not isinstance(model, Surrogate | Flow):
        kind = type(model).__name__
        raise InvalidInput(f"optimise: a {kind} is no drag model; load(name) or Flow(scene) is")


def check_problem(problem: Problem, scene: Scene) -> None:
    """Raise InvalidInput unless the problem is of this scene."""
    expect("optimise", problem, Problem, "Problem")
    if problem.scene != scene:
        found = differences(problem.scene.record, scene.record)
        raise InvalidInput(f"optimise: problem and model are of different scenes: {found}")


def _propose(
    problem: Problem, model: LoadModel | None, evaluated: Sequence[EvaluatedDesign]
) -> Proposal | None:
    """Return the model's optimum, None without a model.

    Raises:
      NotConverged: no search on the model reached an optimum.
    """
    if model is None:
        return None
    best = sorted(evaluated, key=lambda body: body.rank)[:STARTS]
    return propose(problem, model, _variables(best), require_converged=False)


def _accepted(evaluated: Sequence[EvaluatedDesign]) -> bool:
    return any(body.kkt_residual <= KKT_ACCEPTED for body in evaluated)


def _finished(proposal: Proposal, evaluated: Sequence[EvaluatedDesign]) -> bool:
    """Return whether a body is optimal on the flow, and the model predicts no better one."""
    if not evaluated:
        return False
    best = min(evaluated, key=lambda body: body.rank)
    predicted_decrease = (best.value - proposal.value) / max(abs(best.value), LEAST_OBJECTIVE)
    return best.kkt_residual <= KKT_TOLERANCE and predicted_decrease < DECREASE


def _next_body(
    problem: Problem,
    proposal: Proposal | None,
    evaluated: Sequence[EvaluatedDesign],
    failed: Bodies,
) -> Float[np.ndarray, " variables"] | None:
    """Return the body to evaluate next; None where every candidate is near one that was tried.

    It is the proposal. Where its flow has failed, the step to it from the best evaluated body is
    halved; without such a body, or without a proposal, the search starts anew elsewhere.
    """
    if proposal is not None and distance(problem, proposal.variables, failed) >= NEAR:
        return proposal.variables
    if proposal is not None and evaluated:
        best = min(evaluated, key=lambda body: body.rank).variables
        shares = 0.5 ** np.arange(1, HALVINGS + 1)[:, None]
        line = best + shares * (proposal.variables - best)
        for body in line[np.asarray(satisfied(line, problem.limits, -FEASIBLE))]:
            if distance(problem, body, [*failed, *_variables(evaluated)]) >= NEAR:
                return body
    tried = [*failed, *_variables(evaluated)]
    return starting_body(problem, tried, CLEARANCE)


def _variables(evaluated: Sequence[EvaluatedDesign]) -> list[np.ndarray]:
    return [body.variables for body in evaluated]
