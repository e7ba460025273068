"""The optimum of a problem on a differentiable model: SQP from the best of many draws."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from shapeopt.problem.conflicts import candidates
from shapeopt.problem.constraints import FEASIBLE, Limits, satisfied
from shapeopt.problem.feasible import drawn_bodies, number_of_starts
from shapeopt.problem.problem import Problem
from shapeopt.problem.scenarios import (
    LEAST_OBJECTIVE,
    LOAD_BOUNDS,
    LoadModel,
    Scenarios,
    model_loads,
    model_objective,
    objective_and_constraints,
)
from shapeopt.search.evaluated import Bodies
from shapeopt.search.optimality import kkt_residual
from shapeopt.search.sqp import PENALTY, SqpResult, minimise_sqp
from surrogate.arrays import AnyArray
from surrogate.devices import Devices, choose_devices, map_over_devices
from surrogate.errors import InvalidInput, NotConverged

RANKED = 1024  # draws whose objectives are compared
# Parts of a search's end whose last axis is that of the variables.
OVER_VARIABLES = ("variables", "gradient", "by_loads", "path")


class Proposal(NamedTuple):
    """The optimum of a problem on a model: the best end of several searches.

    ``gradient``, ``of_loads`` and ``by_loads`` are as of ``SqpResult``. ``start`` is the objective
    where that search began, ``path`` the bodies on its way, ``calls`` the number of drags that all
    searches evaluated the model for.
    """

    variables: Float[np.ndarray, " variables"]
    value: float
    gradient: Float[np.ndarray, " variables"]
    of_loads: Float[np.ndarray, " constraints"]
    by_loads: Float[np.ndarray, "constraints variables"]
    kkt_residual: float
    start: float
    path: Float[np.ndarray, "steps variables"]
    calls: int


def propose(
    problem: Problem, model: LoadModel, starts: Bodies = (), require_converged: bool = True
) -> Proposal:
    """Return the global optimum of a problem on a model, as ``propose_all`` does.

    Args:
      problem: objective and constraints.
      model: a differentiable model of the loads.
      starts: bodies from which a search starts too.
      require_converged: otherwise the best feasible body will do where no search converged.

    Raises:
      InvalidInput, NotConverged: as ``propose_all``.
    """
    return propose_all([problem], model, starts, require_converged)[0]


def propose_all(
    problems: Sequence[Problem],
    model: LoadModel,
    starts: Bodies = (),
    require_converged: bool = True,
    devices: Devices | None = None,
) -> list[Proposal]:
    """Return the global optimum of every problem on a model, all by the same programs.

    Args:
      problems: of one scene; their constraints and objectives may be of different kinds.
      model: a differentiable model of the loads, by D.
      starts: bodies from which a search starts too, in place of the last draws.
      require_converged: otherwise the best feasible body will do where no search converged.
      devices: over which the problems are spread.

    Returns:
      The best ends, in the order of the problems.

    Raises:
      InvalidInput: no body satisfies the constraints of a problem, or only some are by the chord.
      NotConverged: no search of a problem converged, or none ended at a feasible body.
    """
    if len({problem.by_chord for problem in problems}) > 1:
        raise InvalidInput("optimise: all problems of a call need the same by_chord")
    model = problems[0].reference.model(model)
    limits, scenarios = _stacked(problems)
    most = limits.low.shape[1]  # variables
    drawn = np.stack([_wider(drawn_bodies(problem.limits)[:RANKED], most) for problem in problems])
    devices = devices or choose_devices()
    rows = drawn, limits, scenarios
    begin, feasible = map(np.array, map_over_devices(devices, best_draws, model, rows))
    count = begin.shape[1]
    for k in np.flatnonzero(feasible < count):
        bodies = _wider(candidates(problems[k]), most)
        begin[k] = bodies[np.arange(count) % len(bodies)]
    if starts:
        begin[:, -len(starts) :] = _wider(np.array(starts), most)
    rows = begin, limits, scenarios
    ends, values, evaluations = map_over_devices(devices, minimise_from_all, model, rows)
    found = []
    for k, problem in enumerate(problems):
        end = without_padding(jax.tree.map(lambda leaf, k=k: leaf[k], ends), problem)
        sound = end.feasibility >= FEASIBLE and np.isfinite(end.value)
        if not (sound and (end.converged or not require_converged)):
            raise NotConverged(_failure(problem, model, end))
        at = end.variables, float(end.value), end.gradient
        residual = kkt_residual(problem.limits, *at, end.of_loads, end.by_loads)
        found.append(
            Proposal(
                variables=end.variables,
                value=float(end.value),
                gradient=end.gradient,
                of_loads=end.of_loads,
                by_loads=end.by_loads,
                kkt_residual=residual,
                start=float(values[k]),
                path=end.path[: int(end.steps) + 1],
                calls=(RANKED + int(evaluations[k])) * len(problem.scenarios.weight),
            )
        )
    return found


def without_padding(end: SqpResult, problem: Problem) -> SqpResult:
    """Return the end of a search with the problem's own variables and cases alone."""
    cases, variables = len(problem.scenarios.weight), len(problem.variables)

    def kept(rows):
        by_bound = np.reshape(rows, (len(LOAD_BOUNDS), -1, *rows.shape[1:]))
        return by_bound[:, :cases].reshape(-1, *rows.shape[1:])

    own = {name: getattr(end, name)[..., :variables] for name in OVER_VARIABLES}
    if len(end.of_loads):
        own |= {"of_loads": kept(end.of_loads), "by_loads": kept(own["by_loads"])}
    return end._replace(**own)


def best_draws(
    model: LoadModel,
    drawn: Float[AnyArray, "bodies variables"],
    limits: Limits,
    scenarios: Scenarios,
) -> tuple[Float[Array, "starts variables"], Int[Array, ""]]:
    """Return the best draws of a problem, and how many of its draws are feasible.

    Args:
      model: a differentiable model of the loads.
      drawn: bodies.
      limits: ranges of the variables and constraints on the body.
      scenarios: of the objective, with the bounds on loads.

    Returns:
      The draws of least objective, with a penalty on violated bounds on loads, best first; where
      too few are feasible, the last ones are not. Then the number of feasible draws.
    """
    objectives = jax.vmap(objective_and_constraints, in_axes=(None, 0, None))
    values, constraints = objectives(model, drawn, scenarios)
    violation = jnp.max(-constraints, axis=1, initial=0.0)
    values += PENALTY * jnp.maximum(jnp.abs(values), LEAST_OBJECTIVE) * violation
    values = jnp.where(satisfied(drawn, limits) & ~jnp.isnan(values), values, jnp.inf)
    best = jax.lax.top_k(-values, number_of_starts(drawn.shape[-1]))[1]
    return drawn[best], jnp.sum(jnp.isfinite(values))


def minimise_from_all(
    model: LoadModel,
    starts: Float[AnyArray, "starts variables"],
    limits: Limits,
    scenarios: Scenarios,
) -> tuple[SqpResult, Float[Array, ""], Int[Array, ""]]:
    """Return the best end of the searches of a problem, from all of its starts.

    Args:
      model: a differentiable model of the loads.
      starts: bodies from which the searches start.
      limits: ranges of the variables and constraints on the body.
      scenarios: of the objective, with the bounds on loads.

    Returns:
      The best converged end, or else the best feasible one, or else the one of least violation;
      the objective where that search began, and the number of evaluations of all searches.
    """
    objectives = jax.vmap(model_objective, (None, 0, None))(model, starts, scenarios)
    search = jax.vmap(minimise_sqp, (None, 0, 0, None, None))
    ends = search(model, starts, jnp.abs(objectives), limits, scenarios)
    sound = jnp.isfinite(ends.value) & (ends.feasibility >= FEASIBLE)
    feasible = jnp.where(sound, ends.value, jnp.inf)
    reached = jnp.where(ends.converged, feasible, jnp.inf)
    any_reached = jnp.isfinite(jnp.min(reached))
    nearest = jnp.argmax(jnp.where(jnp.isfinite(ends.value), ends.feasibility, -jnp.inf))
    best = jnp.where(jnp.any(sound), jnp.argmin(feasible), nearest)
    best = jnp.where(any_reached, jnp.argmin(reached), best)
    end = jax.tree.map(lambda leaf: leaf[best], ends)
    return end, objectives[best], len(starts) + jnp.sum(ends.evaluations)


def _failure(problem, model, end):
    """Return why no search of a problem succeeded: a load out of reach, or none converged."""
    values = end.of_loads
    if not (len(values) and np.isfinite(values).all() and np.min(values) < FEASIBLE):
        return "optimise: none of the starts reached an optimum"
    loads = model_loads(model, end.variables, problem.scenarios)[0]
    k, case = divmod(int(np.argmin(values)), len(loads))
    bound, name = list(LOAD_BOUNDS.values())[k], problem.load_bound_names[k * len(loads) + case]
    return (
        f"optimise: {problem.bound_text(name)} is out of reach of these bodies; the nearest found "
        f"has {bound.symbol} {float(loads[case, bound.index]):.3g}"
    )


def _stacked(problems: Sequence[Problem]) -> tuple[Limits, Scenarios]:
    """Stack the arrays of problems, padded by what changes none of their answers."""
    names = {name for problem in problems for name in problem.limits.bounds}
    stations = max(len(problem.stations) for problem in problems)
    cases = max(len(problem.scenarios.weight) for problem in problems)
    sizes = names, stations, cases, max(len(problem.variables) for problem in problems)
    limits = [problem.limits.padded(*sizes) for problem in problems]
    scenarios = [problem.scenarios.padded(cases) for problem in problems]
    return _stack(limits), _stack(scenarios)


def _wider(bodies, variables):
    """Return bodies with zeros for the variables that their problem lacks."""
    return np.pad(bodies, ((0, 0), (0, variables - bodies.shape[1])))


def _stack(trees):
    return jax.tree.map(lambda *leaves: np.stack(leaves), *trees)
