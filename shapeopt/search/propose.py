"""The body that a drag model finds best: draws are ranked, the best of them descended."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from shapeopt.problem.conflicts import candidates
from shapeopt.problem.constraints import Limits, satisfied
from shapeopt.problem.feasible import drawn_bodies
from shapeopt.problem.objective import Scenarios, predicted
from shapeopt.problem.problem import Problem
from shapeopt.search.optimality import optimality
from shapeopt.search.sqp import descend
from surrogate.arrays import AnyArray
from surrogate.devices import Devices, choose_devices, map_over_devices
from surrogate.errors import InvalidInput, NotConverged

RANKED = 1024  # draws
STARTS = 8  # of them, at least; twice the parameters where that is more
WITHIN = -1e-6  # room of constraints that counts as none

Leaders = Sequence[Float[AnyArray, " parameters"]]


class Proposal(NamedTuple):
    """Where a search on a model ended, the objective where it began, drags asked of the model."""

    parameters: Float[np.ndarray, " parameters"]
    value: float
    kkt_residual: float
    start: float
    path: Float[np.ndarray, "steps parameters"]
    calls: int


def propose(problem: Problem, model: Any, leaders: Leaders = (), settled: bool = True) -> Proposal:
    """The global optimum of the problem on a differentiable model; ``leaders`` are starts too.

    Where none of the starts settled, the best body that they came to will do unless ``settled``.

    Raises:
      InvalidInput: no body satisfies the constraints.
      NotConverged: no start reached an optimum, or none a body within the constraints.
    """
    return propose_all([problem], model, leaders, settled)[0]


def propose_all(
    problems: Sequence[Problem],
    model: Any,
    leaders: Leaders = (),
    settled: bool = True,
    devices: Devices | None = None,
) -> list[Proposal]:
    """The same of many problems in one compiled call; they must have as many cases and stations.

    Problems are spread over ``devices``.

    Raises:
      InvalidInput: problems are of different kinds, or no body satisfies the constraints of one.
      NotConverged: no start reached an optimum of one.
    """
    limits = _stacked([problem.limits for problem in problems])
    scenarios = _stacked([problem.scenarios for problem in problems])
    drawn = np.stack([drawn_bodies(problem.limits)[:RANKED] for problem in problems])
    devices = devices or choose_devices()
    rows = drawn, limits, scenarios
    starts, feasible = map(np.array, map_over_devices(devices, best_draws, model, rows))
    count = starts.shape[1]
    for k in np.flatnonzero(feasible < count):
        bodies = candidates(problems[k])
        starts[k] = bodies[np.arange(count) % len(bodies)]
    if leaders:
        starts[:, -len(leaders) :] = np.array(leaders)
    rows = starts, limits, scenarios
    ends, began, turns = map_over_devices(devices, descend_from_all, model, rows)
    found = []
    for k, problem in enumerate(problems):
        end = jax.tree.map(lambda leaf, k=k: leaf[k], ends)
        if not ((end.ended or not settled) and end.room >= WITHIN and np.isfinite(end.value)):
            raise NotConverged("optimise: none of the starts reached an optimum")
        value = float(end.value)
        residual = optimality(problem.limits, end.parameters, value, end.gradient)
        calls = (RANKED + int(turns[k])) * len(problem.scenarios.weight)
        path = end.path[: int(end.moves) + 1]
        found.append(Proposal(end.parameters, value, residual, float(began[k]), path, calls))
    return found


def best_draws(
    model: Any,
    drawn: Float[AnyArray, "problems bodies parameters"],
    limits: Limits,
    scenarios: Scenarios,
) -> tuple[Float[Array, "problems starts parameters"], Int[Array, " problems"]]:
    """The best draws of every problem, and how many of its draws are feasible."""
    count = max(STARTS, 2 * drawn.shape[-1])

    def one(case):
        drawn, limits, scenarios = case
        values = jax.vmap(predicted, in_axes=(None, 0, None))(model, drawn, scenarios)
        values = jnp.where(satisfied(drawn, limits), values, jnp.inf)
        return drawn[jax.lax.top_k(-values, count)[1]], jnp.sum(jnp.isfinite(values))

    return jax.lax.map(one, (drawn, limits, scenarios))


def descend_from_all(
    model: Any,
    starts: Float[AnyArray, "problems starts parameters"],
    limits: Limits,
    scenarios: Scenarios,
) -> tuple[Any, Float[Array, " problems"], Int[Array, " problems"]]:
    """The best end of every problem, the objective where it began, and evaluations of all."""

    def one(case):
        starts, limits, scenarios = case
        ends = jax.vmap(lambda start: descend(model, start, limits, scenarios))(starts)
        sound = jnp.isfinite(ends.value) & (ends.room >= WITHIN)
        within = jnp.where(sound, ends.value, jnp.inf)
        reached = jnp.where(ends.ended, within, jnp.inf)
        best = jnp.where(jnp.isfinite(jnp.min(reached)), jnp.argmin(reached), jnp.argmin(within))
        end = jax.tree.map(lambda leaf: leaf[best], ends)
        return end, predicted(model, starts[best], scenarios), jnp.sum(ends.evaluations)

    return jax.lax.map(one, (starts, limits, scenarios))


def _stacked(values):
    kinds = {tuple(np.shape(leaf) for leaf in jax.tree.leaves(value)) for value in values}
    if len(kinds) > 1:
        raise InvalidInput("problems: of one batch must have as many cases and stations each")
    return jax.tree.map(lambda *leaves: np.stack(leaves), *values)
