"""Verification: what the flow itself says of a body that was proposed."""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from shapeopt.problem.objective import combine
from shapeopt.problem.problem import Problem
from surrogate.arrays import AnyArray, Body
from surrogate.checks import expect
from surrogate.errors import InvalidInput
from surrogate.flow.flow import Flow
from surrogate.flow.solution import Solution


@dataclasses.dataclass(frozen=True)
class Verified:
    """An objective by the flow, every scenario's flow, and the cylinder's drags beside them."""

    objective: float
    cylinder_objective: float
    solutions: tuple[Solution, ...]
    cylinder: Float[AnyArray, " cases"]

    @property
    def drags(self) -> Float[np.ndarray, " cases"]:
        """Cd of every scenario."""
        return np.array([solution.drag for solution in self.solutions])

    @property
    def status(self) -> str:
        """accurate where every flow is, else degraded."""
        statuses = {solution.status for solution in self.solutions}
        return "accurate" if statuses == {"accurate"} else "degraded"

    @property
    def estimated_error(self) -> float | None:
        """The largest of the flows', relative; None where one has no estimate."""
        errors = [solution.estimated_error for solution in self.solutions]
        return None if None in errors else max(errors)

    @property
    def green_applications(self) -> int:
        """Of the body's flows."""
        return sum(solution.green_applications for solution in self.solutions)

    @property
    def seconds(self) -> float:
        """Of the body's flows."""
        return sum(solution.seconds for solution in self.solutions)


def verify(
    problem: Problem,
    parameters: Body,
    cylinder: Float[AnyArray, " cases"] | None = None,
    estimate: bool = True,
) -> Verified:
    """The objective of a body, every scenario's flow solved, with status and estimated error.

    ``cylinder`` are its drags at the same Reynolds numbers, where they are known already.

    Raises:
      InvalidInput: no such body.
      NotConverged: a flow was not found.
    """
    expect("verify", problem, Problem, "Problem")
    flow, scenarios = Flow(problem.scene), problem.scenarios
    parameters = problem.scene.family.check(parameters)
    cylinder = cylinder_drags(problem) if cylinder is None else np.asarray(cylinder)
    sound = np.all((cylinder > 0) & np.isfinite(cylinder))
    if cylinder.shape != scenarios.weight.shape or not sound:
        raise InvalidInput(f"cylinder: {cylinder}; a drag above 0 of every case is needed")
    solutions = tuple(
        flow.solve(parameters + shift, reynolds, estimate=estimate, allow_unsteady=True)
        for shift, reynolds in zip(scenarios.shift, scenarios.reynolds, strict=True)
    )
    drags = np.array([solution.drag for solution in solutions])
    own, others = (combine(*map(jnp.asarray, (d, cylinder)), scenarios) for d in (drags, cylinder))
    return Verified(float(own), float(others), solutions, cylinder)


def cylinder_drags(problem: Problem) -> Float[np.ndarray, " cases"]:
    """Cd of the cylinder at the Reynolds number of every scenario.

    Raises:
      NotConverged: a flow was not found.
    """
    flow, cylinder = Flow(problem.scene), problem.scene.family.ellipse(1.0)
    return np.array(
        [
            flow.solve(cylinder, reynolds, estimate=False, allow_unsteady=True).drag
            for reynolds in problem.scenarios.reynolds
        ]
    )
