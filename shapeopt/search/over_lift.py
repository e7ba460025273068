"""Least drag over a lower bound on the lift, and the best glide ratio."""

import time
from collections.abc import Sequence

from shapeopt.problem.objective import Glide
from shapeopt.problem.problem import Problem
from shapeopt.search.designer import Designer
from shapeopt.search.sheet import Row, expect_one, optima, row_of
from surrogate.model.surrogate import Surrogate
from surrogate.progress import Update


def designs_over_lift(
    model: Surrogate | Designer,
    reynolds: float,
    lifts: Sequence[float],
    progress: Update | None = None,
    **bounds: object,
) -> tuple[list[Row], Row, float]:
    """Optimise bodies under lower bounds on the lift, and one for the best glide ratio.

    Args:
      model: as for ``optima``, of bodies with lift.
      reynolds: the Reynolds number.
      lifts: lower bounds on Cl, one for each body of least drag.
      progress: as for ``optima``.
      **bounds: other constraints of all bodies by their names in ``Problem``.

    Returns:
      A row for every bound on the lift, the row of the best glide ratio Cl / Cd, both as of
      ``row_of`` with the bound "lift" and "why_not" where no body was found, and the wall seconds
      of all.

    Raises:
      InvalidInput: as ``optima``.
      NotConverged: no body was found for any of the bounds.
    """
    scene = model.scene
    problems = [Problem(scene, reynolds, lift=lift, **bounds) for lift in lifts]
    problems.append(Problem(scene, Glide(reynolds), **bounds))
    begin = time.perf_counter()
    found = optima(problems, model, progress)
    seconds = time.perf_counter() - begin
    expect_one(found[:-1])
    pairs = zip(problems, found, strict=True)
    *rows, best = (row_of(problem, one) | {"lift": problem.lift} for problem, one in pairs)
    return rows, best, seconds
