"""A random stream of design problems, the queries that all strategies answer."""

import math
from typing import Any

import jax
import numpy as np

from shapeopt.problem.conflicts import candidates
from shapeopt.problem.objective import Glide
from shapeopt.problem.problem import Problem
from shapeopt.problem.robust import Robust
from shapeopt.problem.uncertainty import LogNormal
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene

LENGTHS, THICKNESSES = (1.3, 2.1), (0.5, 0.85)  # bounds that are active at most optima, in D
HEIGHTS = (0.45, 0.65)  # upper bounds on the height, in 3-D instead of the lower on the thickness
SPREAD = 0.2  # standard deviation of log Re in the robust objective, at most
LIFTS = (0.1, 0.5)  # lower bounds on Cl, in scenes whose bodies have lift
MOMENTS = (0.0, 0.3)  # upper bounds on Cm there
INCIDENCES = (0.25, 0.75)  # shares of its range at which some problems hold the incidence


def plain_queries(scene: Scene, count: int) -> list[Problem]:
    """Return ``count`` problems without constraints, spaced evenly in log Re over the scene.

    They ask for the least drag, or for the best glide ratio where bodies have lift; Re is rounded
    to two digits.
    """
    numbers = [float(f"{value:.2g}") for value in np.geomspace(*scene.reynolds, count)]
    numbers = [float(np.clip(value, *scene.reynolds)) for value in numbers]
    has_lift = scene.family.has_lift
    return [Problem(scene, Glide(re) if has_lift else re) for re in numbers]


def robust_objective(scene: Scene) -> Robust:
    """Return the robust objective for a payoff, about the middle of the range of log Re.

    Its spread is smaller where the range is narrow, so that 95 % of it lies within the range.
    """
    low, high = scene.reynolds
    spread = min(SPREAD, math.log(high / low) / 4)
    return Robust(math.sqrt(low * high), LogNormal(spread), tolerance=0.01, level=0.8)


def query_stream(scene: Scene, seed: int, count: int) -> list[Problem]:
    """Return ``count`` random problems, with log Re uniform over the scene's range.

    A bound on the length and one on the thickness (3-D: on the height) are each set with
    probability 1/2. Where bodies have lift, a problem asks with probability 1/2 for the best glide
    ratio instead of the least drag, then with probability 1/2 at a given incidence, and otherwise
    has a lower bound on the lift; with probability 1/3 it has an upper bound on the moment. Bodies
    satisfy the bounds on length, thickness and height; those on loads may be out of reach.

    Raises:
      InvalidInput: the family's bodies are all longer or thinner than the bounds that are drawn.
    """
    queries: list[Problem] = []
    key = jax.random.fold_in(jax.random.key(seed), 7)
    low, high = np.log(scene.reynolds)
    for _ in range(100 * count):
        if len(queries) == count:
            break
        key, drawing = jax.random.split(key)
        drawn = np.asarray(jax.random.uniform(drawing, (5,), float))
        place, length, thickness, has_length, has_thickness = drawn
        bounds = {"max_length": _between(LENGTHS, length)} if has_length < 0.5 else {}
        if has_thickness < 0.5 and scene.dimension == 3:
            bounds["max_thickness"] = _between(HEIGHTS, thickness)
        elif has_thickness < 0.5:
            bounds["min_thickness"] = _between(THICKNESSES, thickness)
        reynolds = float(np.exp(low + place * (high - low)))
        if scene.family.has_lift:
            glide, more = _with_lift(scene, jax.random.fold_in(drawing, 1))
            reynolds = Glide(reynolds) if glide else reynolds
            bounds |= more
        problem = Problem(scene, reynolds, **bounds)
        try:
            candidates(problem)
        except InvalidInput:
            continue  # the bounds contradict each other
        queries.append(problem)
    if len(queries) < count:
        raise InvalidInput("queries: hardly any bound on length or thickness suits this family")
    return queries


def _with_lift(scene, key):
    """Return whether a problem asks for the glide ratio, and its bounds on loads and incidence."""
    drawn = np.asarray(jax.random.uniform(key, (6,)))
    glides, lift, moment, has_moment, incidence, holds_incidence = drawn
    bounds: dict[str, Any] = {}
    if has_moment < 1 / 3:
        bounds["max_moment"] = _between(MOMENTS, moment)
    if glides >= 0.5:
        return False, bounds | {"lift": _between(LIFTS, lift)}
    ranges = dict(scene.family.ranges)
    if holds_incidence < 0.5 and "incidence" in ranges:
        angle = _between(ranges["incidence"], _between(INCIDENCES, incidence))
        bounds["within"] = {"incidence": (angle, angle)}
    return True, bounds


def _between(ends, share):
    return float(ends[0] + share * (ends[1] - ends[0]))
