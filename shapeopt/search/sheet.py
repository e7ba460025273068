"""Optima over Reynolds number and length, and how much drag each bound costs."""

from collections.abc import Sequence
from typing import Any

from shapeopt.problem.problem import Problem
from shapeopt.search.design import Design
from shapeopt.search.designer import Designer
from shapeopt.search.optimise import optimise_all
from surrogate.model.surrogate import Surrogate
from surrogate.progress import Update


def optima(
    problems: Sequence[Problem], model: Surrogate | Designer, progress: Update | None = None
) -> list[Design]:
    """Return the optimum of every problem, in their order.

    Args:
      problems: of the model's scene.
      model: a surrogate, for its own optima, all in one batch; or a designer, for the flow's, one
        after the other, each of which uses the flows of those before.
      progress: called as ``progress(share, state)`` before each optimum of the flow and at the end.

    Raises:
      InvalidInput, NotConverged: as ``optimise_all`` or ``Designer.design``.
    """
    if isinstance(model, Surrogate):
        return optimise_all(problems, model)
    update, designs, flows = progress or (lambda done, state: None), list[Design](), 0
    for k, problem in enumerate(problems):
        update(k / len(problems), f"design {k + 1} of {len(problems)}, {flows} flows so far")
        designs.append(model.design(problem))
        flows += designs[-1].flows
    update(1.0, f"{len(problems)} designs, {flows} flows")
    return designs


def designs_over(
    model: Surrogate | Designer,
    reynolds: Sequence[float],
    lengths: Sequence[float],
    min_thickness: float | None = None,
    progress: Update | None = None,
) -> tuple[list[dict[str, Any]], float]:
    """Return the optimum at every Re and bound on the length as a row, and the wall seconds of all.

    Args:
      model: as for ``optima``.
      reynolds: Reynolds numbers.
      lengths: upper bounds on the chord, in D.
      min_thickness: lower bound on the maximum thickness of all bodies, in D.
      progress: as for ``optima``.

    Returns:
      Rows by length, then Re, without a bound last; ``excess`` is the drag over that of the
      optimum without a bound on the length, minus 1. Then the wall seconds.

    Raises:
      InvalidInput, NotConverged: as ``optima``.
    """
    problems = [
        Problem(model.scene, re, length, min_thickness)
        for length in (*lengths, None)
        for re in reynolds
    ]
    designs = optima(problems, model, progress)
    unbounded = {d.problem.reynolds: d.drag for d in designs if d.problem.max_length is None}
    rows = [
        {
            "reynolds": design.problem.reynolds,
            "max_length": design.problem.max_length,
            "parameters": model.scene.family.named(design.parameters),
            "chord": design.chord,
            "cd": design.drag,
            "excess": design.drag / unbounded[design.problem.reynolds] - 1,
            "kkt_residual": design.kkt_residual,
            "flows": design.flows,
        }
        for design in designs
    ]
    return rows, sum(design.seconds for design in designs)
