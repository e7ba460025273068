"""Objectives whose Reynolds number depends on the optimum: one problem follows from another."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Float

from shapeopt.problem.problem import Problem
from shapeopt.problem.scenarios import LoadModel
from shapeopt.search.propose import Proposal, propose_all
from surrogate.arrays import AnyArray
from surrogate.devices import Devices
from surrogate.errors import NotConverged

MAX_PROBLEMS = 12  # that follow from each other; Newton's method in log Re takes 3 or 4


def following(
    problem: Problem, loads: Float[AnyArray, " loads"], by_log_reynolds: Float[AnyArray, " loads"]
) -> Problem | None:
    """Return the problem to be solved after a problem's optimum, None where that is the answer.

    Args:
      problem: whose objective has one scenario.
      loads: of its optimum.
      by_log_reynolds: their derivatives in log Re.

    Raises:
      InvalidInput: there is no answer within the scene.
    """
    objective = problem.objective.following(problem.scene, loads, by_log_reynolds)
    return None if objective is None else dataclasses.replace(problem, reynolds=objective)


def follow_all(
    problems: Sequence[Problem], model: LoadModel, devices: Devices | None = None
) -> tuple[list[Problem], list[Proposal]]:
    """Optimise problems, and those that follow from them, on a model; return the last ones.

    A problem with a fixed objective is its own last one.

    Args:
      problems: of one scene.
      model: a differentiable model of the loads.
      devices: over which the problems are spread.

    Returns:
      The last problem that follows from each problem, and the optimum of each last problem.

    Raises:
      InvalidInput: as ``propose_all``; or a problem has no answer within the scene.
      NotConverged: as ``propose_all``; or there is no last problem.
    """
    problems, calls = list(problems), [0] * len(problems)
    last: dict[int, Proposal] = {}
    for _ in range(MAX_PROBLEMS):
        proposals = propose_all(problems, model, devices=devices)  # all, by the same programs
        for k in sorted(set(range(len(problems))) - set(last)):
            calls[k] += proposals[k].calls
            found = _following(model, problems[k], proposals[k])
            if found is None:
                last[k] = proposals[k]._replace(calls=calls[k])
            else:
                problems[k] = found
        if len(last) == len(problems):
            return problems, [last[k] for k in range(len(problems))]
    raise not_followed()


def not_followed() -> NotConverged:
    """Return the error to be raised where every optimum leads to another problem."""
    return NotConverged(f"optimise: no Reynolds number was found in {MAX_PROBLEMS} searches")


def _following(model: LoadModel, problem: Problem, proposal: Proposal) -> Problem | None:
    if problem.objective.fixed:
        return None
    log_re = jnp.log(problem.scenarios.reynolds[0])

    def loads(log_re):
        return model.loads(jnp.asarray(proposal.variables), jnp.exp(log_re))

    return following(problem, *jax.jvp(loads, (log_re,), (jnp.ones_like(log_re),)))
