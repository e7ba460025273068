"""Bodies that satisfy the constraints, or the names of the constraints that cannot be met."""

import dataclasses
import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from shapeopt.problem.constraints import Limits, margins, satisfied
from surrogate.body.measures import chord, radii, thickness, thickness_at
from surrogate.arrays import AnyArray
from surrogate.body.family import PARAMETERS

if TYPE_CHECKING:
    from shapeopt.problem.problem import Problem

DRAWN = 2048
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
        repaired = np.asarray(_repair(drawn, limits))
        found = repaired[np.asarray(satisfied(repaired, limits))]
        bodies = np.concatenate([bodies, found])
    return bodies


def drawn_bodies(limits: Limits) -> Float[AnyArray, "bodies parameters"]:
    """The same draws for every problem, in its own ranges: ellipses, then uniform."""
    ellipses = np.repeat(limits.low[None], 33, axis=0)
    ellipses[:, 0] = np.linspace(limits.low[0], limits.high[0], 33)
    ellipses[:, 1:] = np.clip(0.0, limits.low[1:], limits.high[1:])
    return np.concatenate([ellipses, limits.low + (limits.high - limits.low) * _draws()])


def explain_conflict(problem: "Problem") -> str:
    """Which constraints cannot be met: each that no body satisfies, or a set in contradiction.

    The set is irreducible: without any one of its members some body satisfies the others.
    """
    asked = _asked(problem)
    bare = _without(problem, asked)
    hopeless = []
    for constraint in asked:
        alone = _without(problem, [other for other in asked if other is not constraint])
        if not len(feasible_bodies(alone.limits)):
            hopeless.append(f"{constraint.name}: {_attainable(constraint, bare, alone)}")
    if hopeless:
        return "; ".join(hopeless)
    dropped: list[_Asked] = []
    for constraint in asked:
        if not len(feasible_bodies(_without(problem, [*dropped, constraint]).limits)):
            dropped.append(constraint)
    names = [constraint.name for constraint in asked if constraint not in dropped]
    return " and ".join(names) + " contradict each other at this area; relax one of them"


class _Asked(NamedTuple):
    """One constraint by name, what lifts it, and the quantity that it bounds."""

    name: str
    lift: Callable[["Problem"], dict[str, Any]]
    measure: Callable[[Array], Array] | None = None
    fault: str = "no body of the family is more than"


def _asked(problem):
    asked = []
    if problem.max_length is not None:
        name, fault = (
            f"max length {problem.max_length:g}",
            "every body of the family is longer than",
        )
        asked.append(_Asked(name, lambda p: {"max_length": None}, chord, fault))
    if problem.min_thickness is not None:
        name, fault = (
            f"min thickness {problem.min_thickness:g}",
            "every body of the family is thinner than",
        )
        asked.append(_Asked(name, lambda p: {"min_thickness": None}, thickness, fault))
    for station in problem.stations:
        asked.append(
            _Asked(
                f"thickness {station.thickness:g} at {station.x:g} c",
                functools.partial(_drop_station, station),
                lambda body, x=station.x: thickness_at(body, jnp.asarray(x)),
                "every body of the family is thinner there than",
            )
        )
    if problem.min_radius is not None:
        name, fault = (
            f"min radius {problem.min_radius:g}",
            "every body of the family has somewhere a radius below",
        )
        asked.append(_Asked(name, lambda p: {"min_radius": None}, _least_radius, fault))
    if problem.within is not None:
        asked.append(_Asked("ranges of the parameters", lambda p: {"within": None}))
    if problem.trust:
        asked.append(_Asked(f"trust {problem.trust:g}", lambda p: {"trust": 0.0}))
    return asked


def _least_radius(body):
    return jnp.min(jnp.stack(radii(body)))


def _drop_station(station, problem):
    return {"stations": tuple(other for other in problem.stations if other != station)}


def _without(problem, constraints):
    for constraint in constraints:
        problem = dataclasses.replace(problem, **constraint.lift(problem))
    return problem


def _attainable(constraint, bare, alone):
    """What the family reaches of the bounded quantity: the least violating body's value."""
    if constraint.measure is None:
        return "no body of the family closes properly there"
    drawn = drawn_bodies(bare.limits)
    nearest = jnp.concatenate([drawn, _repair(drawn, alone.limits)])
    nearest = nearest[np.asarray(satisfied(nearest, bare.limits))]
    violation = jax.vmap(lambda body: -jnp.min(margins(body, alone.limits)))(nearest)
    value = float(constraint.measure(nearest[jnp.argmin(violation)]))
    return f"{constraint.fault} {value:.3g} D"


@functools.cache
def _draws():
    draws = jax.random.uniform(jax.random.key(0), (DRAWN - 33, len(PARAMETERS)))
    return np.asarray(draws)


@jax.jit
def _repair(bodies, limits):
    """The least violating bodies after Levenberg-Marquardt steps on the violations, in range."""
    width = jnp.maximum(limits.high - limits.low, 1e-12)

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
