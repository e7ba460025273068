"""Optimisation: the surrogate's own optimum, or the flow's."""

import time
from collections.abc import Sequence

import numpy as np

from shapeopt.problem.problem import Problem
from shapeopt.problem.scenarios import model_loads
from shapeopt.search.design import Design, padded_loads
from shapeopt.search.designer import Designer, check_model, check_problem
from shapeopt.search.following import follow_all
from shapeopt.search.optimality import Derivatives
from shapeopt.search.propose import Proposal
from surrogate.checks import expect
from surrogate.devices import choose_devices
from surrogate.errors import InvalidInput
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate


def optimise(problem: Problem, model: Surrogate | Flow, until: str | None = None) -> Design:
    """Return the body of the scene's family that minimises the problem's objective.

    Flows are steady ones, also beyond the estimated onset of instability of a body.

    Args:
      problem: objective and constraints.
      model: a surrogate of the problem's scene, or the scene's flow.
      until: ``"surrogate"`` ends at the surrogate's own optimum (default with a surrogate);
        ``"flow"`` goes on to an optimum of the flow (default with a flow), as ``Designer`` does,
        which also keeps the flows for later designs, in a file or not.

    Raises:
      InvalidInput: no body satisfies the constraints, or the model is of another scene.
      NotConverged: no start reached an optimum.
    """
    check_model(model)
    check_problem(problem, model.scene)
    if not isinstance(until, str | None) or until not in (None, "surrogate", "flow"):
        raise InvalidInput(f"until {until!r}: 'surrogate' or 'flow'")
    if isinstance(model, Flow) and until == "surrogate":
        raise InvalidInput("until 'surrogate': the model is the flow itself")
    if isinstance(model, Flow) or until == "flow":
        return Designer(model).design(problem)
    return optimise_all([problem], model)[0]


def optimise_all(
    problems: Sequence[Problem], surrogate: Surrogate | Flow, devices: int | None = None
) -> list[Design]:
    """Return the surrogate's own optimum of every problem, all by the same programs.

    Args:
      problems: of the surrogate's scene, all or none ``by_chord``; objectives and constraints may
        be of different kinds. All are padded to the most scenarios, stations and bounds among them.
      surrogate: the model; a flow is refused, a ``Designer`` answers its problems.
      devices: number of devices that the problems are spread over (1).

    Returns:
      Designs in the order of the problems; ``seconds`` of a design is its share of the call.

    Raises:
      InvalidInput: a problem has no feasible body or is of another scene, there are fewer devices,
        or the model is a flow.
      NotConverged: no start reached an optimum of a problem.
    """
    check_model(surrogate)
    if not isinstance(surrogate, Surrogate):
        raise InvalidInput("optimise_all: a surrogate answers many problems; a Designer the flow's")
    expect("optimise_all", problems, list | tuple, "list of problems")
    for problem in problems:
        check_problem(problem, surrogate.scene)
    chosen, begin = choose_devices(devices), time.perf_counter()
    proposals = []
    if problems:
        problems, proposals = follow_all(problems, surrogate.network, chosen)
    share = (time.perf_counter() - begin) / max(len(problems), 1)
    pairs = zip(problems, proposals, strict=True)
    return [_design(problem, surrogate, proposal, share) for problem, proposal in pairs]


def _design(problem: Problem, surrogate: Surrogate, proposal: Proposal, seconds: float) -> Design:
    body, reference = problem.body(proposal.variables), problem.reference
    query = reference.query(body, problem.objective.nominal)
    loads = reference.loads(body, surrogate.loads(*query)).tolist()
    drags = np.array(loads[:1])
    if len(problem.scenarios.weight) > 1:
        model = reference.model(surrogate.network)
        drags = np.asarray(model_loads(model, proposal.variables, problem.scenarios)[0][:, 0])
    known = proposal.gradient, proposal.of_loads, proposal.by_loads, drags
    return Design(
        problem=problem,
        variables=proposal.variables,
        objective=proposal.value,
        loads=padded_loads(loads),
        kkt_residual=proposal.kkt_residual,
        start=proposal.start,
        path=problem.body(proposal.path),
        calls=proposal.calls,
        flows=0,
        green_applications=0,
        seconds=seconds,
        derivatives=Derivatives(*known),
    )
