"""The flow linearised at a state: the solves that training steps are made of, with their work.

Each returns the number of applications of G it spent, so that methods can be compared by work.
Krylov vectors are of single precision: the solves are asked for a few digits.
``A`` is the coupled Jacobian of body flow.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import spread_modes
from surrogate.flow.solver.krylov import gmres
from surrogate.flow.solver.newton import SINGLE, single
from surrogate.flow.solver.steady import (
    FlowState,
    Operators,
    eliminate,
    flow_residual,
    pinning,
    slip_residual,
    stream,
)

FEW_DIGITS = 1e-4  # relative residual that single precision alone reaches
ROUNDS = 8


class Effort(NamedTuple):
    """Krylov limits of one linearised solve."""

    tolerance: float = 1e-2
    max_vectors: int = 40


class Work(NamedTuple):
    """Applications of G, and whether every solve reached its tolerance."""

    products: Int[Array, ""]
    converged: Bool[Array, ""]


def coupled_step(
    domain: Domain, operators: Operators, state: FlowState, effort: Effort
) -> tuple[FlowState, Work]:
    """One Newton step of body flow: x - A^+ F(x), the inverse simulator's step."""
    value = _residual(domain, operators, state)
    inverse = eliminate(domain, operators)
    jacobian, rough = _coupled(domain, *single((operators, state))), single(inverse)
    result = gmres(lambda v: rough(jacobian(v)), single(inverse(value)), *effort)
    return jax.tree.map(jnp.subtract, state, result.x), Work(result.steps + 1, result.converged)


def drag_weights(
    domain: Domain, operators: Operators, state: FlowState, effort: Effort
) -> tuple[Float[Array, " modes"], Work]:
    """Adjoint lambda of the drag: dCd that removing the slip y would cause is lambda . y."""
    adjoint, work = drag_adjoint(domain, operators, state, effort)
    return adjoint.amplitude.astype(float), work


class Query(NamedTuple):
    """What a drag is asked of: a body by what draws its contour, and a Reynolds number."""

    contour: Callable[[Array], Array]
    parameters: Float[AnyArray, " parameters"]
    reynolds: Float[AnyArray, ""]


def drag_slopes(
    domain: Domain, operators: Operators, state: FlowState, query: Query, effort: Effort
) -> tuple[Float[Array, " parameters"], Float[Array, ""], Work]:
    """dCd in the parameters and in Re, by one adjoint: back through the contour, forward in Re."""
    adjoint, work = drag_adjoint(domain, operators, state, effort)
    adjoint = jax.tree.map(lambda leaf: leaf.astype(float), adjoint)

    def around(parameters, reynolds):
        markers = query.contour(parameters)
        body = spread_modes(domain.lattice, domain.modes, domain.box, markers, reynolds)
        return _residual(domain, eqx.tree_at(lambda c: c.body, operators, body), state)

    def at(reynolds):
        moved = stream(domain, reynolds)
        return _residual(domain, eqx.tree_at(lambda c: (c.kernel, c.far), operators, moved), state)

    in_shape, in_re = jax.vjp(around, query.parameters, query.reynolds)[1](adjoint)
    change = jax.jvp(at, (query.reynolds,), (jnp.ones_like(query.reynolds),))[1]
    in_re = in_re + optax.tree.vdot(adjoint, change)
    return in_shape, in_re, work._replace(products=work.products + 2)


def drag_adjoint(
    domain: Domain, operators: Operators, state: FlowState, effort: Effort
) -> tuple[FlowState, Work]:
    """lambda: a Newton step from x adds lambda . F(x) to the drag.

    GMRES in single precision; where that is not enough, its residual is renewed in double.
    """
    goal = FlowState(jnp.zeros_like(state.velocity), jnp.zeros_like(state.amplitude).at[0].set(2.0))
    inverse = eliminate(domain, operators)

    def system(operators, state, inverse):
        adjoint = jax.linear_transpose(_coupled(domain, operators, state), state)
        precondition = jax.linear_transpose(inverse, state)
        return lambda z: precondition(adjoint(z)[0])[0], lambda b: precondition(b)[0]

    matvec, precondition = system(*single((operators, state, inverse)))
    first = gmres(matvec, precondition(single(goal)), *effort)
    if effort.tolerance >= FEW_DIGITS:
        return first.x, Work(first.steps, first.converged)
    exact, renewed = system(operators, state, inverse)
    target = renewed(goal)
    size = optax.tree.norm(target)

    def miss(x):
        return jax.tree.map(jnp.subtract, target, exact(x))

    def unfinished(carry):
        _, residual, _, rounds = carry
        return (optax.tree.norm(residual) > effort.tolerance * size) & (rounds < ROUNDS)

    def improve(carry):
        x, residual, steps, rounds = carry
        needed = 0.7 * effort.tolerance * size / optax.tree.norm(residual)
        needed = jnp.maximum(needed, SINGLE).astype(jnp.float32)
        change = gmres(matvec, single(residual), needed, effort.max_vectors)
        x = jax.tree.map(jnp.add, x, change.x)
        return x, miss(x), steps + change.steps + 1, rounds + 1

    x = jax.tree.map(lambda leaf: leaf.astype(float), first.x)
    start = (x, miss(x), first.steps + 1, jnp.array(0))
    x, residual, steps, _ = jax.lax.while_loop(unfinished, improve, start)
    return x, Work(steps, optax.tree.norm(residual) <= effort.tolerance * size)


def slip_adjoint(
    domain: Domain,
    operators: Operators,
    state: FlowState,
    weights: Float[Array, " modes"],
    effort: Effort,
) -> tuple[Float[Array, " modes"], Work]:
    """(dy/da)^T weights for the slip y of a forced flow: one adjoint solve."""
    operators, state, weights = single((operators, state, weights))

    def respond(amplitude):
        return flow_residual(domain, operators, FlowState(state.velocity, amplitude))

    flow = _flow_block(domain, operators, state)
    adjoint = jax.linear_transpose(flow, state.velocity)
    pulled = jax.vjp(operators.body.slip, state.velocity)[1](weights)[0]
    result = gmres(lambda z: adjoint(z)[0], pulled, *effort)
    gradient = -jax.vjp(respond, state.amplitude)[1](result.x)[0]
    gradient = gradient + pinning(domain, operators).T @ weights
    return gradient.astype(float), Work(result.steps + 1, result.converged)


def compliance(
    domain: Domain, operators: Operators, state: FlowState, effort: Effort
) -> tuple[Float[Array, "modes modes"], Work]:
    """dy/da of a forced flow, one tangent solve per mode."""
    operators, state = single((operators, state))

    def respond(amplitude):
        return flow_residual(domain, operators, FlowState(state.velocity, amplitude))

    flow = _flow_block(domain, operators, state)

    def column(mode):
        response = -jax.jvp(respond, (state.amplitude,), (mode,))[1]
        result = gmres(flow, response, *effort)
        return operators.body.slip(result.x), result.steps + 1, result.converged

    columns, steps, converged = jax.lax.map(
        column, jnp.eye(state.amplitude.size, dtype=state.amplitude.dtype)
    )
    matrix = (columns.T + pinning(domain, operators)).astype(float)
    return matrix, Work(jnp.sum(steps), jnp.all(converged))


def _residual(domain, operators, state):
    return FlowState(
        flow_residual(domain, operators, state), slip_residual(domain, operators, state)
    )


def _coupled(domain, operators, state):
    return jax.linearize(lambda x: _residual(domain, operators, x), state)[1]


def _flow_block(domain, operators, state):
    def residual(velocity):
        return flow_residual(domain, operators, FlowState(velocity, state.amplitude))

    return jax.linearize(residual, state.velocity)[1]
