"""The body of least objective: a surrogate's own optimum, or the flow's."""

import time

from shapeopt.problem.objective import AtReynolds
from shapeopt.problem.problem import Problem
from shapeopt.search.designer import Design, Designer, check_model, check_problem
from shapeopt.search.propose import propose
from surrogate.errors import InvalidInput
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate


def optimise(problem: Problem, model: Surrogate | Flow, until: str | None = None) -> Design:
    """Minimise the problem's objective over the family, within its constraints.

    Args:
      problem: what is asked.
      model: a surrogate of the problem's scene, or its flow.
      until: ``surrogate`` ends at the surrogate's own optimum, as is usual where there is one;
        ``flow`` goes on to the flow's own, by a ``Designer`` that remembers this design alone.

    Raises:
      InvalidInput: no body satisfies the constraints, or the model is of another scene.
      NotConverged: no start reached an optimum, or a flow on the way was not found.
    """
    check_model(model)
    check_problem(problem, model.scene)
    if until not in (None, "surrogate", "flow"):
        raise InvalidInput(f"until {until!r}: 'surrogate' or 'flow'")
    if isinstance(model, Flow) and until == "surrogate":
        raise InvalidInput("until 'surrogate': the model is the flow itself")
    if isinstance(model, Flow) or until == "flow":
        return Designer(model).design(problem)
    return _by_surrogate(problem, model)


def _by_surrogate(problem: Problem, surrogate: Surrogate) -> Design:
    begin = time.perf_counter()
    found, start, calls = propose(problem, surrogate.network)
    drag = found.value
    if not isinstance(problem.objective, AtReynolds):
        drag = float(surrogate.drag(found.parameters, problem.objective.nominal))
    return Design(
        parameters=found.parameters,
        objective=found.value,
        drag=drag,
        kkt_residual=found.kkt_residual,
        start=start,
        path=found.path,
        calls=calls,
        flows=0,
        green_applications=0,
        seconds=time.perf_counter() - begin,
    )
