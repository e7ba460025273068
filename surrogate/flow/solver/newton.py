"""Inexact Newton-Krylov with a derivative by the implicit function theorem."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.flow.solver.krylov import gmres

Operator = Callable[[PyTree], PyTree]


SINGLE = 1e-5  # least relative residual asked of a single-precision Krylov solve


class NewtonSettings(NamedTuple):
    """``tolerance`` bounds the preconditioned residual relative to the solution.

    ``linear_tolerance`` bounds the same of tangent and adjoint solves.
    """

    tolerance: float = 1e-6
    max_steps: int = 25
    max_vectors: int = 40
    forcing: float = 0.2
    linear_tolerance: float = 1e-4


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
    """Root x of ``residual(data, x)``, started at ``guess``, differentiable in ``data``.

    The preconditioner's own dependence on parameters does not enter derivatives. Tangent and
    adjoint cost one GMRES each.
    """
    frozen = system._replace(
        data=jax.lax.stop_gradient(system.data),
        precondition=jax.lax.stop_gradient(system.precondition),
    )
    x, info = _newton(frozen, jax.lax.stop_gradient(guess), norm, settings)

    @jax.custom_jvp
    def attach(data, x, precondition):
        return x

    @attach.defjvp
    def tangent(primals, tangents):
        data, x, precondition = primals
        moved = jax.jvp(lambda d: system.residual(d, x), (data,), tangents[:1])[1]
        here = System(system.residual, data, precondition)
        return x, jax.tree.map(jnp.negative, _solve_tangent(here, x, moved, settings))

    return attach(system.data, *jax.lax.stop_gradient((x, system.precondition))), info


def _solve_tangent(system, x, y, settings):
    """A^-1 y with the Jacobian A at the root, and its transpose when a gradient is pulled back."""

    def systems(transform):
        rough, precondition = single((system.data, system.precondition))
        matvecs = (
            _jacobian(system.residual, system.data, x),
            _jacobian(system.residual, rough, single(x)),
        )
        return [
            (transform(matvec, at), transform(inverse, at))
            for matvec, inverse, at in zip(
                matvecs, (system.precondition, precondition), (x, single(x)), strict=True
            )
        ]

    def transposed(function, at):
        pull = jax.linear_transpose(function, at)
        return lambda v: pull(v)[0]

    def direct(_, b):
        return _refined_gmres(*systems(lambda function, at: function), b, settings)

    def adjoint(_, b):
        return _refined_gmres(*systems(transposed), b, settings)

    matvec = _jacobian(system.residual, system.data, x)
    return jax.lax.custom_linear_solve(matvec, y, direct, adjoint)


def _jacobian(residual, data, x):
    return jax.linearize(lambda y: residual(data, y), x)[1]


def _refined_gmres(double, rough, b, settings):
    """GMRES in single precision, its residual renewed in double until it is small enough.

    NaN where it is not reached.
    """
    (matvec, inverse), (rough_matvec, rough_inverse) = double, rough
    target = inverse(b)
    size = optax.tree.norm(target)

    def unfinished(state):
        _, residual, rounds = state
        return (optax.tree.norm(residual) > settings.linear_tolerance * size) & (rounds < 8)

    def improve(state):
        x, residual, rounds = state
        needed = 0.7 * settings.linear_tolerance * size / optax.tree.norm(residual)
        change = gmres(
            lambda v: rough_inverse(rough_matvec(v)),
            single(residual),
            jnp.maximum(needed, SINGLE).astype(jnp.float32),
            settings.max_vectors,
        )
        x = jax.tree.map(jnp.add, x, change.x)
        return x, jax.tree.map(jnp.subtract, target, inverse(matvec(x))), rounds + 1

    start = (jax.tree.map(jnp.zeros_like, target), target, jnp.array(0))
    x, residual, _ = jax.lax.while_loop(unfinished, improve, start)
    converged = optax.tree.norm(residual) <= settings.linear_tolerance * size
    return jax.tree.map(lambda leaf: jnp.where(converged, leaf, jnp.nan), x)


def _newton(system, x0, norm, settings):
    """Newton steps with Eisenstat-Walker forcing (1996, choice 2) and step halving.

    Residuals are of double precision, directions of single: they need a few digits only.
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
        improving = (size < previous) | (steps == 0)
        return (size > settings.tolerance) & (steps < settings.max_steps) & improving

    b, size = preconditioned(x0)
    start = (x0, b, size, size, jnp.array(0), jnp.array(1))
    x, _, size, _, steps, products = jax.lax.while_loop(unfinished, advance, start)
    return x, NewtonInfo(size <= settings.tolerance, steps, products, size)


def single(tree: PyTree) -> PyTree:
    """The same with every array in single precision."""

    def cast(leaf):
        return leaf.astype(jnp.complex64 if jnp.iscomplexobj(leaf) else jnp.float32)

    return jax.tree.map(cast, tree)
