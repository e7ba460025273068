"""Sequential quadratic programming (SQP) on a differentiable model, in pure JAX.

The Hessian of the Lagrangian is a damped BFGS approximation (Powell 1978), the merit function the
objective plus an exact penalty on the worst violation (Nocedal and Wright 2006, chapter 18). A step
that does not reduce the merit enough is corrected to second order for the curvature of the
constraints (section 18.3 there), and where that does not help shortened, so that every iteration
evaluates the model once, the first one at the start. Equations in ``shapeopt/README.md``,
section 2.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from shapeopt.problem.constraints import Limits, constraint_values_and_jacobian
from shapeopt.problem.scenarios import (
    LEAST_OBJECTIVE,
    LoadModel,
    Scenarios,
    objective_and_constraints,
)
from shapeopt.search.qp import solve_relaxed_qp
from surrogate.arrays import AnyArray

ITERATIONS = 60
# Of a violation, in objectives of the start per D. The penalty is exact where it exceeds the sum of
# the multipliers, the relative changes of the objective per D (Nocedal and Wright, section 17.2).
PENALTY = 30.0
# Predicted relative decrease of the merit below which a search has converged.
MERIT_DECREASE = 1e-11
SHORTEST = 1e-6  # step length below which a search ends
SHORTENING = 0.3  # of a step that is refused
ARMIJO = 1e-4  # share of the predicted decrease that a step must achieve, as usual


class SqpResult(NamedTuple):
    """The end of a search: the body with its objective and gradient, and how the search went.

    ``feasibility`` is the least constraint value; ``of_loads`` are the constraints on loads and
    ``by_loads`` their Jacobian. The first ``steps`` + 1 rows of ``path`` are the bodies on the way.
    """

    variables: Float[Array, " variables"]
    value: Float[Array, ""]
    gradient: Float[Array, " variables"]
    feasibility: Float[Array, ""]
    of_loads: Float[Array, " load_constraints"]
    by_loads: Float[Array, "load_constraints variables"]
    converged: Bool[Array, ""]
    evaluations: Int[Array, ""]
    path: Float[Array, "iterations variables"]
    steps: Int[Array, ""]


class _Point(NamedTuple):
    """An evaluated body, in scaled variables z and in objectives of the start."""

    z: Float[Array, " variables"]
    value: Float[Array, ""]
    gradient: Float[Array, " variables"]
    constraints: Float[Array, " constraints"]
    jacobian: Float[Array, "constraints variables"]


class _Step(NamedTuple):
    """The solution of a quadratic program, and the decrease of the merit that it predicts."""

    change: Float[Array, " variables"]
    multipliers: Float[Array, " constraints"]
    predicted_decrease: Float[Array, ""]


class _State(NamedTuple):
    point: _Point
    hessian: Float[Array, "variables variables"]
    step: _Step
    length: Float[Array, ""]
    corrected: Bool[Array, ""]
    iterations: Int[Array, ""]
    path: Float[Array, "iterations variables"]
    steps: Int[Array, ""]


def minimise_sqp(
    model: LoadModel,
    start: Float[AnyArray, " variables"],
    scale: Float[AnyArray, ""],
    limits: Limits,
    scenarios: Scenarios,
) -> SqpResult:
    """Return the local optimum, from ``start``, of the objective that a model predicts.

    Args:
      model: a differentiable model of the loads.
      start: variables of the first body; clipped to the ranges.
      scale: magnitude of the objective there, which relative changes are taken of.
      limits: ranges of the variables and constraints on the body.
      scenarios: of the objective, with the bounds on loads.

    Returns:
      The end of the search, whether or not it has converged and is feasible.
    """
    low, width = limits.low, limits.width

    def evaluate(z):
        body = low + width * z
        (value, gradient), (of_loads, by_loads) = model_values(model, body, scenarios)
        of_shape, by_shape = constraint_values_and_jacobian(body, limits)
        constraints = jnp.append(of_shape, of_loads)
        jacobian = jnp.concatenate([by_shape, by_loads])
        return _Point(z, value / scale, gradient * width / scale, constraints, jacobian * width)

    def unfinished(state):
        going = (state.step.predicted_decrease > MERIT_DECREASE) & (state.length > SHORTEST)
        going |= state.corrected
        return going & (state.iterations <= ITERATIONS)

    def iterate(state):
        old, step, length = state.point, state.step, state.length
        new = evaluate(jnp.clip(old.z + length * step.change, 0, 1))
        accepted = _merit(new) <= _merit(old) - ARMIJO * length * step.predicted_decrease
        updated = _damped_bfgs(state.hessian, old, new, step.multipliers)
        point, hessian = jax.tree.map(
            lambda a, b: jnp.where(accepted, a, b), (new, updated), (old, state.hessian)
        )
        correct = ~accepted & ~state.corrected & (length == 1)
        curved = new.constraints - old.jacobian @ (new.z - old.z)
        constraints = jnp.where(correct, curved, point.constraints)
        steps = state.steps + accepted
        return _State(
            point,
            hessian,
            _next_step(point, hessian, constraints),
            jnp.where(accepted | correct, 1.0, SHORTENING * length),
            correct,
            state.iterations + 1,
            state.path.at[steps].set(point.z),
            steps,
        )

    scale = jnp.maximum(scale, LEAST_OBJECTIVE)
    z = jnp.clip((start - low) / width, 0, 1)
    blank = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape), jax.eval_shape(evaluate, z))
    # infinite, so that the first step, of length 0, is accepted
    unknown = blank._replace(z=z, value=jnp.array(jnp.inf))
    step = _Step(jnp.zeros_like(z), jnp.zeros_like(blank.constraints), jnp.ones(()))
    path = jnp.zeros((ITERATIONS + 1, z.size))
    zero, no = jnp.zeros((), int), jnp.array(False)
    state = _State(unknown, jnp.eye(z.size), step, jnp.ones(()), no, zero, path, zero - 1)
    state = jax.lax.while_loop(unfinished, iterate, state)
    point = state.point
    shapes = blank.constraints.size - scenarios.load_bounds.size
    # where no step length helps, rounding hides what little decrease is predicted
    tolerance = jnp.where(state.length > SHORTEST, MERIT_DECREASE, 1e3 * MERIT_DECREASE)
    return SqpResult(
        variables=low + width * point.z,
        value=point.value * scale,
        gradient=point.gradient * scale / width,
        feasibility=jnp.min(point.constraints),
        of_loads=point.constraints[shapes:],
        by_loads=point.jacobian[shapes:] / width,
        converged=state.step.predicted_decrease <= tolerance,
        evaluations=state.iterations,
        path=low + width * state.path,
        steps=state.steps,
    )


@jax.jit
def model_values(
    model: LoadModel, body: Float[AnyArray, " variables"], scenarios: Scenarios
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return the objective and its gradient, and the load constraints and their Jacobian."""

    def twice(body):
        values = objective_and_constraints(model, body, scenarios)
        return values, values

    gradients, values = jax.jacrev(twice, has_aux=True)(body)
    return tuple(zip(values, gradients, strict=True))


def _merit(point):
    return point.value + PENALTY * _violation(point.constraints)


def _violation(constraints):
    return jnp.maximum(-jnp.min(constraints), 0.0)


def _next_step(point, hessian, constraints):
    """Return the step of the quadratic program at a point, for these constraint values."""
    bounds = -point.z, 1 - point.z
    change, multipliers = solve_relaxed_qp(
        hessian, point.gradient, constraints, point.jacobian, *bounds, PENALTY
    )
    linearised = constraints + point.jacobian @ change
    relief = _violation(point.constraints) - _violation(linearised)
    return _Step(change, multipliers, PENALTY * relief - point.gradient @ change)


def _damped_bfgs(hessian, old, new, multipliers):
    """Return the BFGS update of the Lagrangian's Hessian, damped to stay positive definite."""
    moved = new.z - old.z
    turned = new.gradient - old.gradient - (new.jacobian - old.jacobian).T @ multipliers
    before = hessian @ moved
    curvature, measured = moved @ before, moved @ turned
    damped = measured < 0.2 * curvature
    share = jnp.where(damped, 0.8 * curvature / (curvature - measured), 1.0)
    turned = share * turned + (1 - share) * before
    change = jnp.outer(turned, turned) / (moved @ turned) - jnp.outer(before, before) / curvature
    return jnp.where(curvature > 1e-30, hessian + change, hessian)
