"""Verification: the objective of a body by the flow, with error estimates."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from shapeopt.problem.problem import Problem
from shapeopt.problem.scenarios import LOAD_BOUNDS, combine, load_constraints
from surrogate.arrays import AnyArray, Body
from surrogate.checks import expect, real_numbers
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.check.error_estimate import accuracy_text
from surrogate.flow.flow import Flow
from surrogate.flow.solution import Solution

NOTICED = 1e-4  # of Cd, violation of a bound on a load that is worth a word
ROUNDING = 1e-9  # relative, of a parameter that an objective holds


@dataclasses.dataclass(frozen=True, eq=False)
class Verified:
    """The objective of a body by the flow, the flows of all scenarios, and the round body's drags.

    ``round_drags`` holds Cd of the cylinder (in 3-D the sphere) at the Reynolds number of every
    scenario, and ``round_objective`` is the objective of these drags; they are None as
    ``drags_of_round_body`` says.
    """

    objective: float
    round_objective: float | None
    solutions: tuple[Solution, ...]
    round_drags: tuple[float | None, ...]

    def __repr__(self) -> str:
        flows = ", ".join(f"Cd {one.drag:.4f} at Re {one.reynolds:g}" for one in self.solutions[:3])
        more = f" and {len(self.solutions) - 3} more" if len(self.solutions) > 3 else ""
        return f"Verified(objective {self.objective:.5g}: {flows}{more}; {self.accuracy})"

    @property
    def status(self) -> str:
        """``accurate`` where every flow is, ``unknown`` without estimates, else ``degraded``."""
        statuses = {solution.status for solution in self.solutions}
        if "unknown" in statuses:
            return "unknown"
        return "accurate" if statuses == {"accurate"} else "degraded"

    @property
    def expected_error(self) -> float | None:
        """The largest expected relative error of the flows; None where one has no estimate."""
        return _largest([solution.expected_error for solution in self.solutions])

    @property
    def estimated_error(self) -> float | None:
        """The largest bound of a flow's relative error; None where one has no estimate."""
        return _largest([solution.estimated_error for solution in self.solutions])

    @property
    def accuracy(self) -> str:
        """A text that says whether every flow meets the tolerance, with the largest errors."""
        errors = self.expected_error, self.estimated_error
        unknown = [one for one in self.solutions if one.expected_error is None]
        cause = next((one.cause for one in unknown or self.solutions if one.cause), "")
        return accuracy_text(self.status, *errors, self.solutions[0].tolerance, cause=cause)

    @property
    def seconds(self) -> float:
        """The wall time of the body's flows in s."""
        return sum(solution.seconds for solution in self.solutions)


def violated_bounds(
    problem: Problem, loads: Float[AnyArray, "cases loads"], tolerance: float = NOTICED
) -> dict[str, float]:
    """Return the bounds on loads that a body violates in its own flows, with the load farthest off.

    Args:
      problem: that sets the bounds.
      loads: of the body in every scenario, as of ``loads_of``.
      tolerance: of a violation, over Cd.

    Returns:
      Cl or Cm by the name of the bound, one of ``problem.load_bound_names``; empty where all are
      met.
    """
    values = np.asarray(load_constraints(loads, problem.scenarios))
    if not values.size:  # there is no lift
        return {}
    indices = [bound.index for bound in LOAD_BOUNDS.values()]
    names, bounded = np.array(problem.load_bound_names), loads.T[indices].ravel()
    order = np.argsort(-values)  # the worst case of a bound is the last of its name
    late = order[values[order] < -tolerance]
    worst = dict(zip(names[late].tolist(), bounded[late].tolist(), strict=True))
    return {name: worst[name] for name in dict.fromkeys(problem.load_bound_names) if name in worst}


def loads_of(
    problem: Problem, variables: Float[AnyArray, " variables"], solutions: Sequence[Solution]
) -> Float[np.ndarray, "cases 3"]:
    """Return Cd, Cl and Cm of a body's flows in all scenarios, by the problem's reference length.

    Args:
      problem: whose scenarios they are.
      variables: of the design.
      solutions: its flows.
    """
    pairs = zip(problem.scenarios.bodies(variables), solutions, strict=True)
    return np.array([loads_by_reference(problem, *pair) for pair in pairs])


def loads_by_reference(
    problem: Problem, parameters: Float[AnyArray, " parameters"], solution: Solution
) -> list[float]:
    """Return Cd, Cl and Cm of a body's flow by the problem's reference length."""
    return problem.reference.loads(parameters, solution.loads).tolist()


def _largest(errors):
    return None if None in errors else max(errors)


def verify(problem: Problem, variables: Body) -> Verified:
    """Solve the flow of every scenario of a problem for one body, and return its objective.

    Objectives and drags are by the problem's reference length, solutions by D.

    Args:
      problem: whose objective is evaluated.
      variables: the body's parameters, and behind them the variables that the objective adds.

    Raises:
      InvalidInput: the parameters describe no body of the family.
      NotConverged: a flow past the body did not converge, or one past the cylinder to whose drag
        the objective is relative.
    """
    expect("verify", problem, Problem, "Problem")
    flow, scenarios = Flow(problem.scene), problem.scenarios
    variables = checked_variables(problem, variables)
    known = drags_of_round_body(problem)
    queries = map(problem.reference.query, scenarios.bodies(variables), scenarios.reynolds)
    solutions = tuple(flow.solve(*query, allow_unsteady=True) for query in queries)
    loads = loads_of(problem, variables, solutions)
    if None in known:  # then the objective does not depend on them
        own = combine(loads, np.ones(len(loads)), scenarios)
        return Verified(float(own), None, solutions, known)
    drags = np.array(known)
    of_round_body = np.pad(drags[:, None], ((0, 0), (0, 2)))  # neither lift nor moment
    own, others = (combine(of, drags, scenarios) for of in (loads, of_round_body))
    return Verified(float(own), float(others), solutions, known)


def checked_variables(problem: Problem, variables: Body) -> Float[AnyArray, " variables"]:
    """Return the variables of a design as floats, with the parameters that its objective holds.

    Args:
      problem: of the design.
      variables: in the order of ``problem.variables``, or the body's parameters by name.

    Raises:
      InvalidInput: they describe no body of the family, or one that the objective excludes.
    """
    family, wanted = problem.scene.family, problem.variables
    if wanted == family.names:
        held = problem.objective.fixed_parameters(problem.scene)
        body = family.check({**held, **variables} if isinstance(variables, Mapping) else variables)
        for name, value in family.named(body).items():
            if abs(value - held.get(name, value)) > ROUNDING * max(1.0, abs(value)):
                raise InvalidInput(
                    f"verify: {name} {value:g}; this objective holds it at {held[name]:g}"
                )
        return body
    values = real_numbers(variables)
    if values is None or values.shape != (len(wanted),):
        raise InvalidInput(f"verify: one number for each of {', '.join(wanted)} is needed")
    for body in problem.scenarios.bodies(values):
        family.check(body)
    return values


def drags_of_round_body(problem: Problem) -> tuple[float | None, ...]:
    """Return Cd of the cylinder (in 3-D the sphere) at the Reynolds number of every scenario.

    It is None where the problem is by the chord or about lift, of which the cylinder has none, and
    where its flow does not converge, as at Re at which slender bodies alone are steady.

    Raises:
      NotConverged: a flow did not converge, and the objective is relative to these drags.
    """
    flow, cylinder = Flow(problem.scene), problem.scene.family.ellipse(1.0)
    known: dict[float, float | None] = {}
    scenarios = problem.scenarios
    if (problem.is_about_lift or problem.by_chord) and not scenarios.relative:
        return (None,) * len(scenarios.reynolds)
    for reynolds in map(float, scenarios.reynolds):
        if reynolds in known:
            continue
        try:
            found = flow.solve(cylinder, reynolds, estimate=False, allow_unsteady=True)
            known[reynolds] = found.drag
        except NotConverged:
            if scenarios.relative:
                raise
            known[reynolds] = None
    return tuple(known[float(reynolds)] for reynolds in scenarios.reynolds)
