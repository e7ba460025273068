"""Least drag of a surrogate's bodies over a lower bound on the lift, and their best glide ratio."""

from collections.abc import Sequence
from typing import Any

from shapeopt.problem.objective import Glide
from shapeopt.problem.problem import Problem
from shapeopt.search.design import Design
from shapeopt.search.optimise import optimise_all
from surrogate.model.surrogate import Surrogate


def designs_over_lift(
    surrogate: Surrogate, reynolds: float, lifts: Sequence[float], **bounds: float | None
) -> tuple[list[dict[str, Any]], dict[str, Any], float]:
    """Optimise bodies under lower bounds on the lift, and for the best glide ratio, in one batch.

    Args:
      surrogate: of bodies with lift.
      reynolds: the Reynolds number.
      lifts: lower bounds on Cl, one for each body of least drag.
      **bounds: other constraints of all bodies by their names in ``Problem``.

    Returns:
      A row for every bound on the lift, the row of the best glide ratio Cl / Cd, and the wall
      seconds of all.

    Raises:
      InvalidInput, NotConverged: as ``optimise_all``.
    """
    scene = surrogate.scene
    problems = [Problem(scene, reynolds, lift=lift, **bounds) for lift in lifts]
    designs = optimise_all([*problems, Problem(scene, Glide(reynolds), **bounds)], surrogate)
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
    }
