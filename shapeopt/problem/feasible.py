"""Bodies that satisfy the constraints, from all over the feasible set."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from shapeopt.problem.constraints import Limits, margins, satisfied
from surrogate.arrays import AnyArray

DRAWN = 2048
ELLIPSES = 33  # of them
REPAIRED = 64
ENOUGH = 8  # feasible draws from which a search can start
ROOM = 1e-6  # a repaired body is this far inside its constraints


def feasible_bodies(limits: Limits) -> Float[AnyArray, "bodies parameters"]:
    """Bodies from all over the feasible set; none where it is empty.

    Where chance finds few of them, the least violating draws are moved until they satisfy.
    """
    drawn = drawn_bodies(limits)
    bodies = drawn[np.asarray(satisfied(drawn, limits))]
    if len(bodies) < ENOUGH:
        repaired = np.asarray(repaired_bodies(drawn, limits))
        found = repaired[np.asarray(satisfied(repaired, limits))]
        bodies = np.concatenate([bodies, found])
    return bodies


def drawn_bodies(limits: Limits) -> Float[AnyArray, "bodies parameters"]:
    """The same draws for every problem, in its own ranges: ellipses, then uniform."""
    aspects = np.linspace(*map(limits.body_class.aspect, (limits.low, limits.high)), ELLIPSES)
    ellipses = [np.clip(limits.body_class.ellipse(a), limits.low, limits.high) for a in aspects]
    draws = _draws(len(limits.low))
    return np.concatenate([ellipses, limits.low + (limits.high - limits.low) * draws])


@functools.cache
def _draws(parameters):
    return np.asarray(jax.random.uniform(jax.random.key(0), (DRAWN - ELLIPSES, parameters)))


@jax.jit
def repaired_bodies(
    bodies: Float[AnyArray, "bodies parameters"], limits: Limits
) -> Float[AnyArray, "some parameters"]:
    """The least violating bodies after Levenberg-Marquardt steps on the violations, in range."""
    width = limits.width

    def violation(z):
        return jnp.maximum(ROOM - margins(limits.low + width * z, limits), 0.0)

    def step(_, z):
        jacobian, miss = jax.jacfwd(violation)(z), violation(z)
        normal = jacobian.T @ jacobian + (1e-6 + 1e-2 * jnp.sum(miss**2)) * jnp.eye(z.size)
        change = jnp.linalg.solve(normal, jacobian.T @ miss)
        return jnp.clip(z - jnp.clip(change, -0.2, 0.2), 0, 1)

    z = (bodies - limits.low) / width
    worst = jax.vmap(lambda z: jnp.sum(violation(z) ** 2))(z)
    z = z[jnp.argsort(worst)[:REPAIRED]]
    z = jax.vmap(lambda z: jax.lax.fori_loop(0, 100, step, z))(z)
    return limits.low + width * z
