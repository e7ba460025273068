"""Inexact Newton-Krylov with a derivative by the implicit function theorem."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.flow.krylov import gmres

Operator = Callable[[PyTree], PyTree]


SINGLE = 1e-5  # least relative residual asked of a single-precision Krylov solve


class NewtonSettings(NamedTuple):
    """``tolerance`` bounds the preconditioned residual relative to the solution."""

    tolerance: float = 1e-8
    max_steps: int = 25
    max_vectors: int = 40
    forcing: float = 0.1
    linear_tolerance: float = 1e-8


class NewtonInfo(NamedTuple):
    """``products`` counts applications of the operator, ``steps`` accepted Newton steps."""

    converged: Bool[Array, ""]
    steps: Int[Array, ""]
    products: Int[Array, ""]
    residual: Float[Array, ""]


class Problem(NamedTuple):
    """``residual(data, x)``, and a linear approximate inverse of its Jacobian, used from the left.

    Data and inverse are pytrees of arrays, so that Krylov vectors can be had in single precision.
    """

    residual: Callable[[PyTree, PyTree], PyTree]
    data: PyTree
    precondition: Operator


class Identity(eqx.Module):
    """No preconditioner."""

    def __call__(self, x: PyTree) -> PyTree:
        return x


def root(
    problem: Problem,
    guess: PyTree,
    norm: Callable[[PyTree], Float[Array, ""]],
    settings: NewtonSettings,
) -> tuple[PyTree, NewtonInfo]:
    """Root x of ``residual(data, x)``, started at ``guess``, differentiable in ``data``.

    The preconditioner's own dependence on parameters does not enter derivatives. Tangent and
    adjoint cost one GMRES each.
    """
    precondition = problem.precondition

    def residual(x):
        return problem.residual(problem.data, x)

    def solve(function, x0):
        x, info = _newton(function, x0, problem, norm, settings)
        return x, jnp.stack([jnp.asarray(field, float) for field in info])  # aux needs tangents

    def tangent_solve(jacobian, y):
        example = jax.tree.map(jnp.zeros_like, y)
        transposed = jax.linear_transpose(precondition, example)

        def direct(matvec, b):
            return _left_gmres(matvec, precondition, b, settings)

        def adjoint(vecmat, b):
            return _left_gmres(vecmat, lambda v: transposed(v)[0], b, settings)

        return jax.lax.custom_linear_solve(jacobian, y, direct, adjoint)

    x, aux = jax.lax.custom_root(residual, guess, solve, tangent_solve, has_aux=True)
    converged, steps, products, size = jax.lax.stop_gradient(aux)
    return x, NewtonInfo(converged > 0, steps.astype(int), products.astype(int), size)


def _left_gmres(matvec, precondition, b, settings):
    result = gmres(
        lambda v: precondition(matvec(v)),
        precondition(b),
        settings.linear_tolerance,
        settings.max_vectors,
    )
    return jax.tree.map(lambda x: jnp.where(result.converged, x, jnp.nan), result.x)


def _newton(function, x0, problem, norm, settings):
    """Newton steps with Eisenstat-Walker forcing (1996, choice 2) and step halving.

    Residuals are of double precision, directions of single: they need a few digits only.
    """
    rough, precondition = jax.lax.stop_gradient(_single((problem.data, problem.precondition)))

    def preconditioned(x):
        b = problem.precondition(function(x))
        return b, norm(b) / norm(x)

    def direction(x, b, size, previous):
        _, jacobian = jax.linearize(lambda y: problem.residual(rough, y), _single(x))
        target = jnp.maximum(0.5 * settings.tolerance / size, SINGLE)
        forcing = jnp.clip(0.9 * (size / previous) ** 2, target, settings.forcing)
        forcing = forcing.astype(jnp.float32)
        return gmres(lambda v: precondition(jacobian(v)), _single(b), forcing, settings.max_vectors)

    def advance(state):
        x, b, size, previous, steps, products = state
        change = direction(x, b, size, previous)

        def attempt(trial):
            damping, _, _, _, products = trial
            candidate = jax.tree.map(lambda a, d: a - damping * d, x, change.x)
            return damping / 2, candidate, *preconditioned(candidate), products + 1

        def rejected(trial):
            damping, _, _, new, _ = trial
            return ~(new < size) & (damping > 0.05)

        trial = attempt((jnp.array(1.0), x, b, size, products + change.steps))
        _, x, b, new, products = jax.lax.while_loop(rejected, attempt, trial)
        return x, b, new, size, steps + 1, products

    def unfinished(state):
        _, _, size, previous, steps, _ = state
        improving = (size < previous) | (steps == 0)
        return (size > settings.tolerance) & (steps < settings.max_steps) & improving

    b, size = preconditioned(x0)
    start = (x0, b, size, size, jnp.array(0), jnp.array(1))
    x, _, size, _, steps, products = jax.lax.while_loop(unfinished, advance, start)
    return x, NewtonInfo(size <= settings.tolerance, steps, products, size)


def _single(tree):
    """The same with every array in single precision."""

    def cast(leaf):
        return leaf.astype(jnp.complex64 if jnp.iscomplexobj(leaf) else jnp.float32)

    return jax.tree.map(cast, tree)
