"""Verification: what the flow itself says of a body the surrogate proposed."""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from shapeopt.problem.objective import CYLINDER, combine
from shapeopt.problem.problem import Problem
from surrogate.arrays import AnyArray
from surrogate.body.family import family_markers
from surrogate.flow.flow import DragReport, report
from surrogate.scene.scene import Scene
from surrogate.training.physics import scene_domain


@dataclasses.dataclass(frozen=True)
class Verified:
    """An objective by the flow, the drags of its scenarios, and the time of their solves."""

    value: float
    drags: Float[AnyArray, " cases"]
    wall_s: float


def verify(scene: Scene, parameters: AnyArray, reynolds: float) -> DragReport:
    """Body flow of a family body on the scene's own grid.

    Raises:
      NotConverged: the flow was not found.
    """
    domain = scene_domain(scene)
    return report(domain, np.asarray(family_markers(parameters, domain.nodes)), reynolds)


def verify_objective(
    problem: Problem, parameters: AnyArray, cylinder: Float[AnyArray, " cases"]
) -> Verified:
    """The objective of a body, every scenario's flow solved.

    Raises:
      NotConverged: a flow was not found.
    """
    scenarios = problem.scenarios
    pairs = zip(scenarios.shift, scenarios.reynolds, strict=True)
    reports = [verify(problem.scene, parameters + shift, float(re)) for shift, re in pairs]
    drags = np.array([report.cd for report in reports])
    value = combined(drags, cylinder, problem)
    return Verified(value, drags, sum(report.wall_s for report in reports))


def combined(
    drags: Float[AnyArray, " cases"], cylinder: Float[AnyArray, " cases"], problem: Problem
) -> float:
    """The objective from the drags of its scenarios."""
    return float(combine(jnp.asarray(drags), jnp.asarray(cylinder), problem.scenarios))


def cylinder_drags(problem: Problem) -> Float[AnyArray, " cases"]:
    """Cd of the cylinder, exact in shape, at the Reynolds number of every scenario."""
    reynolds = problem.scenarios.reynolds
    return np.array([verify(problem.scene, CYLINDER, float(re)).cd for re in reynolds])
