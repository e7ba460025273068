"""Inexact Newton-Krylov: residuals of double precision, directions of single."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.flow.solver.krylov import gmres

Operator = Callable[[PyTree], PyTree]


SINGLE = 1e-5  # least relative residual asked of a single-precision Krylov solve


class NewtonSettings(NamedTuple):
    """``tolerance`` bounds the preconditioned residual relative to the solution.

    ``linear_tolerance`` bounds the same of the adjoint solves that gradients take.
    """

    tolerance: float = 1e-6
    max_steps: int = 25
    max_vectors: int = 40
    forcing: float = 0.2
    linear_tolerance: float = 1e-5


class NewtonInfo(NamedTuple):
    """``products`` counts applications of the operator, ``steps`` Newton steps."""

    converged: Bool[Array, ""]
    steps: Int[Array, ""]
    products: Int[Array, ""]
    residual: Float[Array, ""]


class System(NamedTuple):
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
    system: System,
    guess: PyTree,
    norm: Callable[[PyTree], Float[Array, ""]],
    settings: NewtonSettings,
) -> tuple[PyTree, NewtonInfo]:
    """Root x of ``residual(data, x)``, started at ``guess``; derivatives are the adjoint's matter.

    Newton steps with Eisenstat-Walker forcing (1996, choice 2) and step halving. Residuals are of
    double precision, directions of single: they need a few digits only.
    """
    rough, precondition = single((system.data, system.precondition))

    def preconditioned(x):
        b = system.precondition(system.residual(system.data, x))
        return b, norm(b) / norm(x)

    def direction(x, b, size, previous):
        jacobian = _jacobian(system.residual, rough, single(x))
        target = jnp.maximum(0.5 * settings.tolerance / size, SINGLE)
        forcing = jnp.clip(0.9 * (size / previous) ** 2, target, settings.forcing)
        forcing = forcing.astype(jnp.float32)
        return gmres(lambda v: precondition(jacobian(v)), single(b), forcing, settings.max_vectors)

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
        evaluate_by_inversion = (size < previous) | (steps == 0)
        return (size > settings.tolerance) & (steps < settings.max_steps) & evaluate_by_inversion

    b, size = preconditioned(guess)
    start = (guess, b, size, size, jnp.array(0), jnp.array(1))
    x, _, size, _, steps, products = jax.lax.while_loop(unfinished, advance, start)
    return x, NewtonInfo(size <= settings.tolerance, steps, products, size)


def _jacobian(residual, data, x):
    return jax.linearize(lambda y: residual(data, y), x)[1]


def single(tree: PyTree) -> PyTree:
    """The same with every array in single precision."""

    def cast(leaf):
        return leaf.astype(jnp.complex64 if jnp.iscomplexobj(leaf) else jnp.float32)

    return jax.tree.map(cast, tree)
