"""Feasible bodies, from all over the set that the constraints leave."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from shapeopt.problem.constraints import Limits, constraint_values, satisfied
from surrogate.arrays import AnyArray

DRAWN = 2048
ELLIPSES = 33  # of the drawn bodies
REPAIRED = 64
STARTS = 8  # bodies from which a search starts, or twice as many as variables if that is more
INSIDE = 1e-6  # constraint value that a repaired body reaches, so that rounding cannot violate it


def feasible_bodies(limits: Limits) -> Float[np.ndarray, "bodies variables"]:
    """Return bodies from all over the feasible set; none where it is empty.

    Where fewer draws are feasible than a search starts from, the least violating ones are moved
    until they are.
    """
    drawn = drawn_bodies(limits)
    bodies = drawn[np.asarray(satisfied(drawn, limits))]
    if len(bodies) < number_of_starts(len(limits.low)):
        repaired = np.asarray(repaired_bodies(drawn, limits))
        found = repaired[np.asarray(satisfied(repaired, limits))]
        bodies = np.concatenate([bodies, found])
    return bodies


def number_of_starts(variables: int) -> int:
    """Return the number of initial bodies of a search in this many variables."""
    return max(STARTS, 2 * variables)


def drawn_bodies(limits: Limits) -> Float[np.ndarray, "bodies variables"]:
    """Return bodies within the ranges: ellipses of all aspects, then uniform draws.

    The draws, as shares of the ranges, are the same for every problem.
    """
    aspects = np.linspace(*map(limits.body_class.aspect, (limits.low, limits.high)), ELLIPSES)
    ellipses = np.array([limits.body_class.ellipse(aspect) for aspect in aspects])
    others = len(limits.low) - ellipses.shape[1]
    ellipses = np.pad(ellipses, ((0, 0), (0, others))).clip(limits.low, limits.high)
    draws = _uniform_draws(len(limits.low))
    return np.concatenate([ellipses, limits.low + (limits.high - limits.low) * draws])


@functools.cache
def _uniform_draws(variables):
    return np.asarray(jax.random.uniform(jax.random.key(0), (DRAWN - ELLIPSES, variables)))


@jax.jit
def repaired_bodies(
    bodies: Float[AnyArray, "bodies variables"], limits: Limits
) -> Float[Array, "repaired variables"]:
    """Return the least violating bodies after Levenberg-Marquardt steps on their violations."""
    width = limits.width

    def violation(z):
        return jnp.maximum(INSIDE - constraint_values(limits.low + width * z, limits), 0.0)

    def step(_, z):
        jacobian, residual = jax.jacfwd(violation)(z), violation(z)
        damping = 1e-6 + 1e-2 * jnp.sum(residual**2)
        normal = jacobian.T @ jacobian + damping * jnp.eye(z.size)
        change = jnp.linalg.solve(normal, jacobian.T @ residual)
        return jnp.clip(z - jnp.clip(change, -0.2, 0.2), 0, 1)

    z = (bodies - limits.low) / width
    worst = jax.vmap(lambda z: jnp.sum(violation(z) ** 2))(z)
    z = z[jnp.argsort(worst)[:REPAIRED]]
    z = jax.vmap(lambda z: jax.lax.fori_loop(0, 100, step, z))(z)
    return limits.low + width * z
