"""Adjoints of loads: the gradient of any functional of a solved flow, by one linear solve.

With F(x, p) = 0 the equations of body flow in the state x = (u', a), p the body's markers and Re,
and J a load, the adjoint lambda solves A^T lambda = -dJ/dx, A = dF/dx, and dJ/dp = (explicit) +
lambda . dF/dp (equation (7) of ``surrogate/flow/README.md``). GMRES runs in single precision,
preconditioned by the transposed elimination; where that is not enough its residual is renewed in
double precision.
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
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.loads import Load
from surrogate.flow.solver.krylov import gmres
from surrogate.flow.solver.newton import SINGLE, single
from surrogate.flow.solver.steady import (
    FlowState,
    Operators,
    eliminate,
    residual,
    stream_operators,
)

SINGLE_SUFFICES = 1e-4  # relative residual down to which single precision alone is reliable
MAX_RENEWALS = 8  # of the residual in double precision
RENEWAL_MARGIN = 0.7  # of the reduction still needed, so that rounding does not ask for one more


class Effort(NamedTuple):
    """Relative tolerance and largest number of Krylov vectors of one linear solve."""

    tolerance: float = 1e-2
    max_vectors: int = 40


class Work(NamedTuple):
    """Convolutions with G that were spent, and whether every solve reached its tolerance."""

    products: Int[Array, ""]
    converged: Bool[Array, ""]


class LoadGradient(NamedTuple):
    """Derivatives of a load in the body's markers and in Re, and the work they took."""

    by_markers: Markers
    by_reynolds: Float[Array, ""]
    work: Work


def load_gradient(
    load: Load,
    domain: Domain,
    operators: Operators,
    state: FlowState,
    reynolds: Float[AnyArray, ""],
    effort: Effort,
) -> LoadGradient:
    """Return the gradient of a load by one adjoint: reverse in the markers, forward in Re."""

    def value(amplitude, markers):
        return load(domain.modes, amplitude, markers)

    by_amplitude, explicit = jax.grad(value, (0, 1))(state.amplitude, operators.markers)
    adjoint, work = load_adjoint(domain, operators, state, by_amplitude, effort)
    adjoint = jax.tree.map(lambda leaf: leaf.astype(float), adjoint)

    def with_body(markers, reynolds):
        body = domain.spread_body(markers, reynolds)
        return residual(domain, eqx.tree_at(lambda o: o.body, operators, body), state)

    def with_stream(reynolds):
        moved = stream_operators(domain, reynolds)
        return residual(domain, eqx.tree_at(lambda o: (o.green, o.far), operators, moved), state)

    by_body, by_re = jax.vjp(with_body, operators.markers, reynolds)[1](adjoint)
    change = jax.jvp(with_stream, (reynolds,), (jnp.ones_like(reynolds),))[1]
    by_re = by_re + optax.tree.vdot(adjoint, change)
    by_markers = jax.tree.map(jnp.add, explicit, by_body)
    return LoadGradient(by_markers, by_re, work._replace(products=work.products + 2))


def load_adjoint(
    domain: Domain,
    operators: Operators,
    state: FlowState,
    by_amplitude: Float[Array, " modes"],
    effort: Effort,
) -> tuple[FlowState, Work]:
    """Solve A^T lambda = -dJ/dx for a load whose derivative in the amplitudes is given.

    A Newton step from x, x - A^-1 F(x), then changes the load by lambda . F(x) to first order.
    """
    goal = FlowState(jnp.zeros_like(state.velocity), -by_amplitude)
    inverse = eliminate(domain, operators)

    def system(operators, state, inverse):
        adjoint = jax.linear_transpose(coupled_jacobian(domain, operators, state), state)
        precondition = jax.linear_transpose(inverse, state)
        return lambda z: precondition(adjoint(z)[0])[0], lambda b: precondition(b)[0]

    matvec, precondition = system(*single((operators, state, inverse)))
    first = gmres(matvec, precondition(single(goal)), *effort)
    if effort.tolerance >= SINGLE_SUFFICES:
        return first.x, Work(first.steps, first.converged)
    exact, renewed = system(operators, state, inverse)
    target = renewed(goal)
    size = optax.tree.norm(target)

    def remainder(x):
        return jax.tree.map(jnp.subtract, target, exact(x))

    def unfinished(carry):
        _, left, _, renewals = carry
        return (optax.tree.norm(left) > effort.tolerance * size) & (renewals < MAX_RENEWALS)

    def improve(carry):
        x, left, steps, renewals = carry
        needed = RENEWAL_MARGIN * effort.tolerance * size / optax.tree.norm(left)
        needed = jnp.maximum(needed, SINGLE).astype(jnp.float32)
        change = gmres(matvec, single(left), needed, effort.max_vectors)
        x = jax.tree.map(jnp.add, x, change.x)
        return x, remainder(x), steps + change.steps + 1, renewals + 1

    x = jax.tree.map(lambda leaf: leaf.astype(float), first.x)
    start = (x, remainder(x), first.steps + 1, jnp.array(0))
    x, left, steps, _ = jax.lax.while_loop(unfinished, improve, start)
    return x, Work(steps, optax.tree.norm(left) <= effort.tolerance * size)


def slip_weights(
    load: Load,
    domain: Domain,
    operators: Operators,
    state: FlowState,
    effort: Effort,
) -> tuple[Float[Array, " modes"], Work]:
    """Return the weights lambda by which removing a slip y changes a load: dJ = lambda . y."""

    def value(amplitude):
        return load(domain.modes, amplitude, operators.markers)

    by_amplitude = jax.grad(value)(state.amplitude)
    adjoint, work = load_adjoint(domain, operators, state, by_amplitude, effort)
    return adjoint.amplitude.astype(float), work


def coupled_jacobian(
    domain: Domain, operators: Operators, state: FlowState
) -> Callable[[FlowState], FlowState]:
    """Return A = dF/dx of body flow at a state, as a linear function."""
    return jax.linearize(lambda x: residual(domain, operators, x), state)[1]
