"""One descent on a differentiable model by SQP: pure, to be vmapped over starts.

Quadratic programs whose constraints one slack relaxes at a price, so that each has a solution;
Mehrotra's predictor and corrector solve them; damped BFGS of the Lagrangian (Powell) gives the
curvature (Nocedal and Wright 2006, chapters 16 and 18). A step that does not pay is shortened and
tried again, so that every turn of the loop asks the model once.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from shapeopt.problem.constraints import Limits
from shapeopt.problem.objective import Scenarios, predicted
from shapeopt.search.optimality import margins_and_slopes
from surrogate.arrays import AnyArray

STEPS = 60
INTERIOR = 8  # steps of a quadratic program
MANY, MORE = 20, 20  # constraints, from which it takes so many
PRICE = 30.0  # of a violation of 1 D, in objectives
ENDED = 1e-11  # of the objective: a step that promises less is the last
SHORTEST = 1e-6  # part of a step that is still tried
ARMIJO = 1e-4


class End(NamedTuple):
    """Where a descent ended, the least room of its constraints, the bodies on the way."""

    parameters: Float[Array, " parameters"]
    value: Float[Array, ""]
    gradient: Float[Array, " parameters"]
    room: Float[Array, ""]
    ended: Bool[Array, ""]
    evaluations: Int[Array, ""]
    path: Float[Array, "steps parameters"]
    moves: Int[Array, ""]


class _Point(NamedTuple):
    """In parameters over their ranges and in objectives of the start."""

    z: Float[Array, " parameters"]
    value: Float[Array, ""]
    gradient: Float[Array, " parameters"]
    room: Float[Array, " constraints"]
    jacobian: Float[Array, "constraints parameters"]


class _Step(NamedTuple):
    """A change of the parameters, its multipliers, and what it promises of the merit."""

    change: Float[Array, " parameters"]
    multipliers: Float[Array, " constraints"]
    promise: Float[Array, ""]


class _State(NamedTuple):
    point: _Point
    curvature: Float[Array, "parameters parameters"]
    step: _Step
    length: Float[Array, ""]
    turns: Int[Array, ""]
    path: Float[Array, "steps parameters"]
    moves: Int[Array, ""]


def descend(
    model: Any, start: Float[AnyArray, " parameters"], limits: Limits, scenarios: Scenarios
) -> End:
    """The local optimum of the objective that ``model`` predicts, within the constraints."""
    low, width = limits.low, limits.width

    def evaluate(z):
        body = low + width * z
        value, gradient = jax.value_and_grad(predicted, argnums=1)(model, body, scenarios)
        room, jacobian = margins_and_slopes(body, limits)
        return _Point(z, value / scale, gradient * width / scale, room, jacobian * width)

    def goes_on(state):
        going = (state.step.promise > ENDED) & (state.length > SHORTEST)
        return going & (state.turns < STEPS)

    def turn(state):
        old, step, length = state.point, state.step, state.length
        new = evaluate(jnp.clip(old.z + length * step.change, 0, 1))
        pays = _merit(new) <= _merit(old) - ARMIJO * length * step.promise
        bent = _bent(state.curvature, old, new, step.multipliers)
        point, curvature = jax.tree.map(
            lambda a, b: jnp.where(pays, a, b), (new, bent), (old, state.curvature)
        )
        moves = state.moves + pays
        return _State(
            point,
            curvature,
            _best_step(point, curvature),
            jnp.where(pays, 1.0, 0.3 * length),
            state.turns + 1,
            state.path.at[moves].set(point.z),
            moves,
        )

    z = jnp.clip((start - low) / width, 0, 1)
    scale = jnp.abs(predicted(model, low + width * z, scenarios))
    first, curvature = evaluate(z), jnp.eye(z.size)
    path = jnp.zeros((STEPS + 1, z.size)).at[0].set(z)
    none = jnp.zeros((), int)
    state = _State(first, curvature, _best_step(first, curvature), jnp.ones(()), none, path, none)
    state = jax.lax.while_loop(goes_on, turn, state)
    point = state.point
    return End(
        parameters=low + width * point.z,
        value=point.value * scale,
        gradient=point.gradient * scale / width,
        room=jnp.min(point.room),
        ended=state.step.promise <= jnp.where(state.length > SHORTEST, ENDED, 1e3 * ENDED),
        evaluations=state.turns + 2,
        path=low + width * state.path,
        moves=state.moves,
    )


def _merit(point):
    return point.value + PRICE * _violation(point.room)


def _violation(room):
    return jnp.maximum(-jnp.min(room), 0.0)


def _bent(curvature, old, new, multipliers):
    """BFGS of the Lagrangian, damped so that it stays positive definite."""
    moved = new.z - old.z
    turned = new.gradient - old.gradient - (new.jacobian - old.jacobian).T @ multipliers
    before = curvature @ moved
    along, seen = moved @ before, moved @ turned
    share = jnp.where(seen >= 0.2 * along, 1.0, 0.8 * along / (along - seen))
    turned = share * turned + (1 - share) * before
    change = jnp.outer(turned, turned) / (moved @ turned) - jnp.outer(before, before) / along
    return jnp.where(along > 1e-30, curvature + change, curvature)


def _best_step(point, curvature):
    """min g d + d B d / 2 + PRICE t with room + J d + t >= 0, t >= 0 and z + d in range."""
    size, many = point.z.size, point.room.size
    hessian = jnp.eye(size + 1).at[:size, :size].set(curvature).at[-1, -1].set(1e-6)
    slope, eye = jnp.append(point.gradient, PRICE), jnp.eye(size + 1)
    rows = jnp.concatenate([jnp.append(point.jacobian, jnp.ones((many, 1)), 1), eye, -eye[:-1]])
    room = jnp.concatenate([point.room, point.z, jnp.zeros(1), 1 - point.z])

    def interior(_, carry):
        x, slack, dual = carry
        off, gap = hessian @ x + slope - rows.T @ dual, rows @ x + room - slack
        weight = dual / slack
        inverse = _inverse(hessian + (rows.T * weight) @ rows)

        def newton(target):
            """The step to dual * slack = target."""
            push = (target - dual * slack) / slack - weight * gap
            dx = inverse @ (rows.T @ push - off)
            return dx, rows @ dx + gap, push - weight * (rows @ dx)

        _, ds, dm = newton(0.0)
        reach = _reach(slack, dual, ds, dm)
        mean = jnp.mean(dual * slack)
        centre = jnp.mean((slack + reach * ds) * (dual + reach * dm)) ** 3 / mean**2
        dx, ds, dm = newton(centre - ds * dm)
        reach = 0.995 * _reach(slack, dual, ds, dm)
        return x + reach * dx, slack + reach * ds, dual + reach * dm

    slack = jnp.maximum(room, 1e-2)
    begin = jnp.zeros(size + 1), slack, 0.1 / slack
    steps = INTERIOR if many < MANY else MORE
    x, _, dual = jax.lax.fori_loop(0, steps, interior, begin)
    change = jnp.clip(x[:-1], -point.z, 1 - point.z)
    relief = _violation(point.room) - _violation(point.room + point.jacobian @ change)
    return _Step(change, dual[:many], PRICE * relief - point.gradient @ change)


def _reach(slack, dual, ds, dm):
    """How far slack and dual stay positive, 1 at most."""
    values, changes = jnp.append(slack, dual), jnp.append(ds, dm)
    falls = changes < 0
    return jnp.min(jnp.where(falls, -values / jnp.where(falls, changes, -1.0), 1.0), initial=1.0)


def _inverse(matrix):
    """Of a small positive definite matrix, by Gauss and Jordan: LAPACK has no lanes."""
    size = matrix.shape[0]
    work = jnp.append(matrix, jnp.eye(size), axis=1)
    for k in range(size):
        row = work[k] / work[k, k]
        work = (work - jnp.outer(work[:, k], row)).at[k].set(row)
    return work[:, size:]
