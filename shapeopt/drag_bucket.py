"""Least drag over a lower bound on the lift, and the best glide ratio."""

from collections.abc import Sequence
from typing import Any

from shapeopt.problem.objective import Glide
from shapeopt.problem.problem import Problem
from shapeopt.search.design import Design
from shapeopt.search.designer import Designer
from shapeopt.search.sheet import optima
from surrogate.model.surrogate import Surrogate
from surrogate.progress import Update


def designs_over_lift(
    model: Surrogate | Designer,
    reynolds: float,
    lifts: Sequence[float],
    progress: Update | None = None,
    **bounds: float | None,
) -> tuple[list[dict[str, Any]], dict[str, Any], float]:
    """Optimise bodies under lower bounds on the lift, and one for the best glide ratio.

    Args:
      model: as for ``optima``, of bodies with lift.
      reynolds: the Reynolds number.
      lifts: lower bounds on Cl, one for each body of least drag.
      progress: as for ``optima``.
      **bounds: other constraints of all bodies by their names in ``Problem``.

    Returns:
      A row for every bound on the lift, the row of the best glide ratio Cl / Cd, and the wall
      seconds of all.

    Raises:
      InvalidInput, NotConverged: as ``optima``.
    """
    scene = model.scene
    problems = [Problem(scene, reynolds, lift=lift, **bounds) for lift in lifts]
    designs = optima([*problems, Problem(scene, Glide(reynolds), **bounds)], model, progress)
    *rows, best = map(_row, designs)
    return rows, best, sum(design.seconds for design in designs)


def _row(design: Design) -> dict[str, Any]:
    problem = design.problem
    return {
        "reynolds": problem.objective.nominal,
        "lift": problem.lift,
        "parameters": problem.scene.family.named(design.parameters),
        "chord": design.chord,
        "cd": design.drag,
        "cl": design.lift,
        "cm": design.moment,
        "glide": design.lift / design.drag,
        "kkt_residual": design.kkt_residual,
        "flows": design.flows,
    }
