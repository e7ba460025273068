"""Inexact Newton-Krylov: residuals in double precision, directions in single precision."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.arrays import full_single_precision, single
from surrogate.flow.solver.krylov import gmres

Operator = Callable[[PyTree], PyTree]

SINGLE = 1e-5  # least relative residual asked of a Krylov solve in single precision (eps 6e-8)
FULL_FORCING = 0.9  # gamma of Eisenstat and Walker's choice 2
LEAST_DAMPING = 0.05  # of a Newton step; one that does not help at 1 / 16 ends the solve


class NewtonSettings(NamedTuple):
    """The tolerances and limits of the Newton solver.

    Attributes:
      tolerance: preconditioned residual over the solution at which a flow has converged.
      max_steps: Newton steps.
      max_vectors: Krylov vectors of one linear solve.
      forcing: largest relative residual that is asked of a linear solve.
      linear_tolerance: relative residual of the adjoint solves of gradients.
    """

    tolerance: float = 1e-6
    max_steps: int = 25
    max_vectors: int = 40
    forcing: float = 0.2
    linear_tolerance: float = 1e-5


class NewtonInfo(NamedTuple):
    """The outcome of a Newton solve; ``convolutions`` is the number of those with G.

    ``residual`` is the preconditioned residual over the solution at the end; ``stalled`` is whether
    the last step did not lessen it, even halved to 1/16 (or it is not finite); x is then worse
    than before that step.
    """

    converged: Bool[Array, ""]
    steps: Int[Array, ""]
    convolutions: Int[Array, ""]
    residual: Float[Array, ""]
    stalled: Bool[Array, ""]


class System(NamedTuple):
    """A non-linear system: a residual F(data, x), and an approximate inverse of its Jacobian.

    The inverse is linear and is used from the left. Data and inverse are pytrees of arrays, so that
    both can be cast to single precision.
    """

    residual: Callable[[PyTree, PyTree], PyTree]
    data: PyTree
    precondition: Operator


class Identity(eqx.Module):
    """The preconditioner that does nothing."""

    def __call__(self, x: PyTree) -> PyTree:
        return x


def root(
    system: System,
    guess: PyTree,
    norm: Callable[[PyTree], Float[Array, ""]],
    settings: NewtonSettings,
) -> tuple[PyTree, NewtonInfo]:
    """Find a root x of ``residual(data, x)`` from a guess; it is not differentiable (see adjoint).

    Newton steps with Eisenstat and Walker's forcing terms (1996, choice 2) and step halving.
    Directions need a few digits only, so they are computed in single precision.

    Args:
      system: residual, its data and the preconditioner.
      guess: x to begin from.
      norm: of x and of the preconditioned residual.
      settings: tolerances and limits.

    Returns:
      x, and whether and how the solve converged; no exception is raised.
    """
    rough, precondition = single((system.data, system.precondition))

    def preconditioned(x):
        b = system.precondition(system.residual(system.data, x))
        return b, norm(b) / norm(x)

    @full_single_precision
    def direction(x, b, size, reduction):
        jacobian = _jacobian(system.residual, rough, single(x))
        target = jnp.maximum(0.5 * settings.tolerance / size, SINGLE)
        forcing = jnp.clip(FULL_FORCING * reduction**2, target, settings.forcing)
        forcing = forcing.astype(jnp.float32)
        return gmres(lambda v: precondition(jacobian(v)), single(b), forcing, settings.max_vectors)

    def advance(state):
        x, b, size, reduction, steps, convolutions = state
        change = direction(x, b, size, reduction)

        def attempt(trial):
            damping, _, _, _, convolutions = trial
            candidate = jax.tree.map(lambda a, d: a - damping * d, x, change.x)
            return damping / 2, candidate, *preconditioned(candidate), convolutions + 1

        def rejected(trial):
            damping, _, _, new, _ = trial
            return ~(new < size) & (damping > LEAST_DAMPING)

        longest = jnp.where(steps < 0, 2 * LEAST_DAMPING, 1.0)  # one attempt at the guess is enough
        trial = longest, x, b, jnp.array(jnp.inf), convolutions + change.steps
        _, x, b, new, convolutions = jax.lax.while_loop(rejected, attempt, trial)
        reduction = jnp.where(steps < 0, 1.0, new / size)
        return x, b, new, reduction, steps + 1, convolutions

    def unfinished(state):
        _, _, size, reduction, steps, _ = state
        improving = (reduction < 1) | (steps <= 0)
        return (size > settings.tolerance) & (steps < settings.max_steps) & improving

    # The first pass, from a residual of zeros, evaluates the residual at the guess and is no step.
    nothing = jax.tree.map(jnp.zeros_like, guess)
    size, reduction = jnp.array(jnp.inf), jnp.array(1.0)
    start = guess, nothing, size, reduction, jnp.array(-1), jnp.array(0)
    x, _, size, reduction, steps, convolutions = jax.lax.while_loop(unfinished, advance, start)
    converged = size <= settings.tolerance
    return x, NewtonInfo(converged, steps, convolutions, size, ~converged & ~(reduction < 1))


def _jacobian(residual, data, x):
    return jax.linearize(lambda y: residual(data, y), x)[1]
