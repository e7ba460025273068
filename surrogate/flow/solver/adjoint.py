"""Adjoints of loads: the gradient of any functional of a solved flow, by one linear solve each.

With F(x, p) = 0 the equations of body flow in the state x = (u', a), p the body's markers and Re,
and J a load, the adjoint lambda solves A^T lambda = -dJ/dx, A = dF/dx, and dJ/dp = (explicit) +
lambda . dF/dp (equation (7) of ``surrogate/flow/README.md``). GMRES runs in single precision,
preconditioned by the transposed elimination; where that is not enough its residual is renewed in
double precision.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray, compute_where, full_single_precision, single
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.loads import Load, load_values
from surrogate.flow.solver.krylov import gmres
from surrogate.flow.solver.newton import SINGLE
from surrogate.flow.solver.steady import (
    FlowState,
    Operators,
    StreamOperators,
    eliminate,
    momentum_source,
    residual,
    slip_residual,
    without_far_field,
)

SINGLE_SUFFICES = 1e-4  # relative residual down to which single precision alone is reliable
MAX_RENEWALS = 8  # of the residual in double precision
RENEWAL_MARGIN = 0.7  # of the reduction still needed, so that rounding does not ask for one more


class Effort(NamedTuple):
    """The effort of one linear solve: relative tolerance, and largest number of Krylov vectors."""

    tolerance: float
    max_vectors: int


def is_rough(efforts: tuple[Effort, ...]) -> bool:
    """Return whether adjoints of these tolerances need no more than single precision."""
    return all(one.tolerance >= SINGLE_SUFFICES for one in efforts)


class LinearSolveInfo(NamedTuple):
    """How linear solves ended: convolutions with G, and whether all reached their tolerance."""

    convolutions: Int[Array, ""]
    converged: Bool[Array, ""]


class LoadGradients(NamedTuple):
    """The derivatives of loads in the body's markers and in Re, loads first, and their work.

    Attributes:
      by_markers: dJ/d(markers), with an axis of the loads before those of the markers.
      by_reynolds: dJ/dRe by the operators of the body alone; ``by_stream`` is the rest.
      adjoints: lambda, with an axis of the loads before those of the flow.
      work: whose ``converged`` is false where an adjoint missed its tolerance.
    """

    by_markers: Markers
    by_reynolds: Float[Array, " loads"]
    adjoints: FlowState
    work: LinearSolveInfo


@full_single_precision
def load_gradients(
    loads: tuple[Load, ...],
    domain: Domain,
    operators: Operators,
    state: FlowState,
    reynolds: Float[AnyArray, ""],
    efforts: tuple[Effort, ...],
) -> LoadGradients:
    """Return the gradients of loads in the body's markers and in Re, by one adjoint for each load.

    It is equation (7) of ``surrogate/flow/README.md`` in reverse mode, for Re in the body's
    operators alone; ``by_stream`` has the rest in forward mode, for those who ask for dJ/dRe. All
    adjoints share the linearised flow and the preconditioner. A load that is zero by symmetry takes
    no Krylov vector.

    Args:
      loads: functions J(modes, amplitude, markers), as in ``surrogate.flow.loads``.
      domain: the discrete problem.
      operators: of the body, from ``assemble``, at this Re.
      state: the converged body flow.
      reynolds: U D / nu.
      efforts: of the adjoints' linear solves, one for each load; all may take the largest number
        of Krylov vectors among them.
    """

    values = functools.partial(load_values, domain.modes, loads)

    def with_body(markers, reynolds):
        body = domain.spread_body(markers, reynolds)
        moved = eqx.tree_at(lambda o: o.body, operators, body)
        return momentum_source(domain, moved, state), slip_residual(moved, state)

    by_amplitude, explicit = jax.jacrev(values, (0, 1))(state.amplitude, operators.markers)
    solve = adjoint_solver(domain, operators, state, max(one.max_vectors for one in efforts))
    pull = jax.vjp(with_body, operators.markers, reynolds)[1]
    rounded = single if is_rough(efforts) else lambda tree: tree
    green = rounded(operators.green)

    def one_load(problem):
        adjoint, work = solve(*problem)
        adjoint = jax.tree.map(lambda leaf: leaf.astype(float), adjoint)
        by_source = -green.transposed(rounded(adjoint.velocity)).astype(float)
        return *pull((by_source, adjoint.amplitude)), adjoint, work

    tolerances = jnp.array([one.tolerance for one in efforts])
    by_body, by_re, adjoints, work = jax.lax.map(one_load, (by_amplitude, tolerances))
    by_markers = jax.tree.map(jnp.add, explicit, by_body)
    convolutions = jnp.sum(work.convolutions) + len(loads)
    total = LinearSolveInfo(convolutions, jnp.all(work.converged))
    return LoadGradients(by_markers, by_re, adjoints, total)


@full_single_precision
def by_stream(
    domain: Domain,
    operators: Operators,
    state: FlowState,
    derivatives: StreamOperators,
    adjoints: FlowState,
    efforts: tuple[Effort, ...],
) -> Float[Array, " loads"]:
    """Return the part of dJ/dRe of loads that comes from G and from the far field.

    Args:
      domain: the discrete problem.
      operators: of the body.
      state: the converged body flow.
      derivatives: of the stream's operators in Re.
      adjoints: of the loads, as in ``LoadGradients``.
      efforts: of the adjoints; where single precision suffices for them, it does here.
    """
    if is_rough(efforts):
        operators, state, derivatives = single((operators, state, derivatives))

    def with_stream(stream):
        moved = eqx.tree_at(lambda o: (o.green, o.far), operators, tuple(stream))
        return residual(domain, moved, state)

    stream = StreamOperators(operators.green, operators.far)
    change = jax.jvp(with_stream, (stream,), (derivatives,))[1]
    change = jax.tree.map(lambda leaf: leaf.astype(float), change)
    return jax.vmap(optax.tree.vdot, (0, None))(adjoints, change)


@full_single_precision
def adjoint_solver(
    domain: Domain, operators: Operators, state: FlowState, max_vectors: int
) -> Callable[[Float[Array, " modes"], Float[AnyArray, ""]], tuple[FlowState, LinearSolveInfo]]:
    """Return a function that solves A^T lambda = -dJ/dx, given a load's dJ/da and a tolerance.

    A Newton step from x, x - A^-1 F(x), then changes the load by lambda . F(x) to first order.

    Args:
      domain: the discrete problem.
      operators: of the body.
      state: x, of the flow at which F is linearised.
      max_vectors: largest number of Krylov vectors.
    """
    inverse = eliminate(operators)

    def system(operators, state, inverse):
        adjoint = transposed_jacobian(domain, operators, state)
        precondition = jax.linear_transpose(inverse, state)
        return lambda z: precondition(adjoint(z))[0], lambda b: precondition(b)[0]

    matvec, _ = system(*single((operators, state, inverse)))
    exact, precondition = system(operators, state, inverse)

    def solve(by_amplitude, tolerance):
        goal = FlowState(jnp.zeros_like(state.velocity), -by_amplitude)
        target = precondition(goal)
        size = optax.tree.norm(target)
        nothing = jax.tree.map(jnp.zeros_like, target)

        def remainder(x):
            return jax.tree.map(jnp.subtract, target, exact(x))

        def unfinished(carry):
            _, left, _, passes = carry
            return (optax.tree.norm(left) > tolerance * size) & (passes <= MAX_RENEWALS)

        def improve(carry):
            x, left, steps, passes = carry
            margin = jnp.where(passes == 0, 1.0, RENEWAL_MARGIN)
            needed = margin * tolerance * size / optax.tree.norm(left)
            needed = jnp.maximum(needed, SINGLE).astype(jnp.float32)
            change = gmres(matvec, single(left), needed, max_vectors)
            x = jax.tree.map(jnp.add, x, change.x)
            enough = (passes == 0) & change.converged & (tolerance >= SINGLE_SUFFICES)
            left = compute_where(~enough, lambda: remainder(x), nothing)
            return x, left, steps + change.steps + jnp.where(enough, 0, 1), passes + 1

        start = nothing, target, jnp.array(0), jnp.array(0)
        x, left, steps, _ = jax.lax.while_loop(unfinished, improve, start)
        return x, LinearSolveInfo(steps, optax.tree.norm(left) <= tolerance * size)

    return solve


def slip_weights(
    load: Load,
    domain: Domain,
    operators: Operators,
    state: FlowState,
    effort: Effort,
) -> tuple[Float[Array, " modes"], LinearSolveInfo]:
    """Return the weights lambda by which removing a slip y changes a load: dJ = lambda . y.

    Args:
      load: a function J(modes, amplitude, markers).
      domain: the discrete problem.
      operators: of the body.
      state: of the flow at which its equations are linearised.
      effort: of the adjoint's linear solve.
    """

    def value(amplitude):
        return load(domain.modes, amplitude, operators.markers)

    by_amplitude = jax.grad(value)(state.amplitude)
    solve = adjoint_solver(domain, operators, state, effort.max_vectors)
    adjoint, work = solve(by_amplitude, jnp.asarray(effort.tolerance))
    return adjoint.amplitude.astype(float), work


def transposed_jacobian(
    domain: Domain, operators: Operators, state: FlowState
) -> Callable[[FlowState], FlowState]:
    """Return A^T, the transpose of A = dF/dx of body flow at a state, as a linear function.

    G is transposed by its ``transposed``, what is left of F by JAX.
    """

    def source(x):
        return momentum_source(domain, operators, x)

    def without_green(x):
        others = without_far_field(domain, operators, x)
        return FlowState(others, slip_residual(operators, x))

    def transpose(function):
        return jax.linear_transpose(jax.linearize(function, state)[1], state)

    of_source, of_others = transpose(source), transpose(without_green)

    def product(z):
        by_source, by_others = of_source(operators.green.transposed(z.velocity)), of_others(z)
        return jax.tree.map(jnp.subtract, *by_others, *by_source)

    return product
