"""A surrogate's designs over Reynolds number and length, and what each bound costs."""

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
    """A row for every bound on the length and Re, those of any length last; seconds of all.

    ``excess`` is the drag over that of any length, less 1.

    Raises:
      InvalidInput, NotConverged: as ``optimise_all``.
    """
    asked = [
        Problem(surrogate.scene, re, length, min_thickness)
        for length in (*lengths, None)
        for re in reynolds
    ]
    designs = optimise_all(asked, surrogate)
    free = {p.reynolds: d.drag for p, d in zip(asked, designs, strict=True) if p.max_length is None}
    rows = [
        {
            "reynolds": problem.reynolds,
            "max_length": problem.max_length,
            "parameters": surrogate.scene.family.named(design.parameters),
            "cd": design.drag,
            "excess": design.drag / free[problem.reynolds] - 1,
            "kkt_residual": design.kkt_residual,
        }
        for problem, design in zip(asked, designs, strict=True)
    ]
    return rows, sum(design.seconds for design in designs)
