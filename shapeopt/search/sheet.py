"""Optima of a surrogate over Reynolds number and length, and how much drag each bound costs."""

from collections.abc import Sequence
from typing import Any

from shapeopt.problem.problem import Problem
from shapeopt.search.optimise import optimise_all
from surrogate.model.surrogate import Surrogate


def designs_over(
    surrogate: Surrogate,
    reynolds: Sequence[float],
    lengths: Sequence[float],
    min_thickness: float | None = None,
) -> tuple[list[dict[str, Any]], float]:
    """Return the optimum at every Re and bound on the length as a row, and the wall seconds of all.

    Args:
      surrogate: the model.
      reynolds: Reynolds numbers.
      lengths: upper bounds on the chord, in D.
      min_thickness: lower bound on the maximum thickness of all bodies, in D.

    Returns:
      Rows by length, then Re, without a bound last; ``excess`` is the drag over that of the
      optimum without a bound on the length, minus 1. Then the wall seconds.

    Raises:
      InvalidInput, NotConverged: as ``optimise_all``.
    """
    problems = [
        Problem(surrogate.scene, re, length, min_thickness)
        for length in (*lengths, None)
        for re in reynolds
    ]
    designs = optimise_all(problems, surrogate)
    unbounded = {d.problem.reynolds: d.drag for d in designs if d.problem.max_length is None}
    rows = [
        {
            "reynolds": design.problem.reynolds,
            "max_length": design.problem.max_length,
            "parameters": surrogate.scene.family.named(design.parameters),
            "chord": design.chord,
            "cd": design.drag,
            "excess": design.drag / unbounded[design.problem.reynolds] - 1,
            "kkt_residual": design.kkt_residual,
        }
        for design in designs
    ]
    return rows, sum(design.seconds for design in designs)
