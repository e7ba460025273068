"""The names of constraints that cannot be met."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from shapeopt.problem.constraints import margins, satisfied
from shapeopt.problem.feasible import drawn_bodies, feasible_bodies, repaired_bodies
from shapeopt.problem.problem import Problem
from surrogate.arrays import AnyArray
from surrogate.errors import InvalidInput


def candidates(problem: Problem) -> Float[AnyArray, "bodies parameters"]:
    """Feasible bodies from all over the family.

    Raises:
      InvalidInput: there is none; the message names the constraints in conflict.
    """
    bodies = feasible_bodies(problem.limits)
    if not len(bodies):
        raise InvalidInput(explain_conflict(problem))
    return bodies


def explain_conflict(problem: Problem) -> str:
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
    lift: Callable[[Problem], dict[str, Any]]
    measure: Callable[[Array], Array] | None = None
    fault: str = "no body of the family is more than"


def _asked(problem):
    body = problem.scene.family.body_class
    every = "every body of the family is"
    thin, long, thick = f"{every} thinner", f"{every} longer than", f"{every} thicker than"
    bounds = (
        ("max_length", "max length", body.length, long),
        ("min_thickness", "min thickness", body.thickness, f"{thin} than"),
        ("max_thickness", "max thickness", body.thickness, thick),
        (
            "min_radius",
            "min radius",
            lambda p: jnp.min(jnp.stack(body.radii(p))),
            "every body of the family has somewhere a radius below",
        ),
    )
    asked = [
        _Asked(f"{words} {bound:g}", lambda p, name=name: {name: None}, measure, fault)
        for name, words, measure, fault in bounds
        if (bound := getattr(problem, name)) is not None
    ]
    asked += [
        _Asked(
            f"thickness {station.thickness:g} at {station.x:g} c",
            functools.partial(_drop_station, station),
            lambda p, x=station.x: body.thickness_at(p, jnp.asarray(x)),
            f"{thin} there than",
        )
        for station in problem.stations
    ]
    if problem.within:
        asked.append(_Asked("ranges of the parameters", lambda p: {"within": None}))
    if problem.trust:
        asked.append(_Asked(f"trust {problem.trust:g}", lambda p: {"trust": 0.0}))
    return asked


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
    nearest = jnp.concatenate([drawn, repaired_bodies(drawn, alone.limits)])
    nearest = nearest[np.asarray(satisfied(nearest, bare.limits))]
    violation = jax.vmap(lambda body: -jnp.min(margins(body, alone.limits)))(nearest)
    value = float(constraint.measure(nearest[jnp.argmin(violation)]))
    return f"{constraint.fault} {value:.3g} D"
