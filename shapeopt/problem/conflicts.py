"""Constraints that cannot be met, named for a message."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from shapeopt.problem.constraints import BOUNDS, EVERY, constraint_values, satisfied
from shapeopt.problem.feasible import drawn_bodies, feasible_bodies, repaired_bodies
from shapeopt.problem.problem import Problem
from surrogate.errors import InvalidInput


def candidates(problem: Problem) -> Float[np.ndarray, "bodies variables"]:
    """Return feasible bodies from all over the family's ranges.

    Raises:
      InvalidInput: there is none; the message names the constraints in conflict.
    """
    bodies = feasible_bodies(problem.limits)
    if not len(bodies):
        raise InvalidInput(explain_conflict(problem))
    return bodies


def explain_conflict(problem: Problem) -> str:
    """Return a message that names the constraints which no body satisfies.

    They are single ones that cannot be met, or else a set in contradiction. The set is irreducible:
    without any one of its members some body satisfies the others.
    """
    constraints = _constraints(problem)
    free = _without(problem, constraints)
    if not _feasible(free):
        shifted = ", with the objective's changes of shape," if free.limits.shift.any() else ""
        return (
            f"family: every body in its ranges{shifted} crosses itself or is too thin; other "
            "ranges would do"
        )
    alone = {c: _without(problem, [d for d in constraints if d is not c]) for c in constraints}
    impossible = [
        f"{constraint.name}: {_nearest_value(constraint, free, single)}"
        for constraint, single in alone.items()
        if not _feasible(single)
    ]
    if impossible:
        wider = [] if problem.within or problem.trust else ["wider ranges of the scene may help"]
        corners, aspect_of = (free.limits.low, free.limits.high), free.limits.body_class.aspect
        ends = [float(aspect_of(corner)) for corner in corners]
        if problem.by_chord and ends != list(dict(problem.scene.family.ranges)["aspect"]):
            low, high = (f"{aspect:.3g}" for aspect in ends)
            wider.append(f"at this chord Reynolds number aspects {low} to {high} can be solved")
        return "; ".join([*impossible, *wider])
    dropped: list[_Constraint] = []
    for constraint in constraints:
        if not _feasible(_without(problem, [*dropped, constraint])):
            dropped.append(constraint)
    names = [constraint.name for constraint in constraints if constraint not in dropped]
    size = "fixed chord" if problem.by_chord else problem.scene.family.body_class.size
    return f"{' and '.join(names)} contradict each other for bodies of {size}; relax one of them"


class _Constraint(NamedTuple):
    """A constraint by name, how to remove it from a problem, and the quantity that it bounds."""

    name: str
    remove: Callable[[Problem], Problem]
    measure: Callable[[Float[Array, " parameters"]], Float[Array, ""]] | None = None
    conflict: str = ""


def _constraints(problem: Problem) -> list[_Constraint]:
    """Return the constraints that a problem sets."""
    body_class, unit = problem.scene.family.body_class, problem.reference.length
    found = [
        _Constraint(
            f"{name.replace('_', ' ')} {getattr(problem, name):g}",
            lambda p, name=name: dataclasses.replace(p, **{name: None}),
            lambda body, b=bound: (
                b.sense * jnp.min(b.sense * b.values(body_class, body)) / unit(body)
            ),
            bound.conflict,
        )
        for name, bound in BOUNDS.items()
        if getattr(problem, name) is not None
    ]
    found += [
        _Constraint(
            f"thickness {station.thickness:g} at {station.x:g} c",
            lambda p, station=station: dataclasses.replace(
                p, stations=tuple(other for other in p.stations if other != station)
            ),
            lambda body, x=station.x: body_class.thickness_at(body, jnp.asarray(x)) / unit(body),
            f"{EVERY} is thinner there than",
        )
        for station in problem.stations
    ]
    if problem.within:
        words = "ranges of the parameters"
        found.append(_Constraint(words, lambda p: dataclasses.replace(p, within=None)))
    if problem.trust:
        words = f"trust {problem.trust:g}"
        found.append(_Constraint(words, lambda p: dataclasses.replace(p, trust=0.0)))
    return found


def _without(problem: Problem, constraints: Sequence[_Constraint]) -> Problem:
    for constraint in constraints:
        problem = constraint.remove(problem)
    return problem


def _feasible(problem: Problem) -> bool:
    return len(feasible_bodies(problem.limits)) > 0


def _nearest_value(constraint: _Constraint, free: Problem, alone: Problem) -> str:
    """Return, as a text, the bounded quantity of the body that violates the constraint least."""
    if constraint.measure is None:
        return "no body of the family closes properly there"
    drawn = drawn_bodies(free.limits)
    parts = drawn, np.asarray(repaired_bodies(drawn, alone.limits))
    clear = np.concatenate([satisfied(part, free.limits) for part in parts])
    bodies = np.concatenate(parts)
    values = np.asarray(jax.vmap(constraint_values, (0, None))(bodies, alone.limits))
    nearest = bodies[clear][np.argmax(values[clear].min(axis=1))]
    value = float(jax.jit(constraint.measure)(free.body(nearest)))
    return f"{constraint.conflict} {value:.3g} {free.reference.symbol}"
