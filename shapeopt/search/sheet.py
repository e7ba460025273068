"""Optima of many problems, and those over Reynolds number and length with what each bound costs."""

import time
from collections.abc import Sequence
from typing import Any

from shapeopt.problem.problem import Problem
from shapeopt.search.design import Design
from shapeopt.search.designer import Designer
from shapeopt.search.optimise import optimise_all
from surrogate.errors import NotConverged
from surrogate.model.surrogate import Surrogate
from surrogate.progress import Update

Row = dict[str, Any]
OF_DESIGN = "chord", "thickness", "kkt_residual", "multipliers", "flows", "onset"  # as in Design
OPTIMUM = (  # the entries of a row that has an optimum
    *("parameters", "chord", "thickness", "cd", "cl", "cm", "glide", "kkt_residual"),
    *("multipliers", "flows", "onset", "at_range_ends"),
)


def optima(
    problems: Sequence[Problem], model: Surrogate | Designer, progress: Update | None = None
) -> list[Design | NotConverged]:
    """Return the optimum of every problem, or the reason why there is none, in their order.

    Args:
      problems: of the model's scene.
      model: a surrogate, for its own optima, all in one batch; or a designer, for the flow's, one
        after the other, each of which uses the flows of those before.
      progress: called as ``progress(share, state)`` before each optimum of the flow and at the end.

    Raises:
      InvalidInput: as ``optimise_all`` or ``Designer.design``.
    """
    if isinstance(model, Surrogate):
        try:
            return list(optimise_all(problems, model))
        except NotConverged:  # of one of them at least
            return [_optimum(model, problem) for problem in problems]
    update, before = progress or (lambda done, state: None), model.memory.flows
    found: list[Design | NotConverged] = []
    for k, problem in enumerate(problems):
        flows = model.memory.flows - before
        update(k / len(problems), f"design {k + 1} of {len(problems)}, {flows} flows so far")
        found.append(_optimum(model, problem))
    update(1.0, f"{len(problems)} designs, {model.memory.flows - before} flows")
    return found


def expect_one(found: Sequence[Design | NotConverged]) -> None:
    """Raise the first reason unless an optimum was found."""
    if not any(isinstance(one, Design) for one in found):
        raise found[0]


def _optimum(model: Surrogate | Designer, problem: Problem) -> Design | NotConverged:
    try:
        if isinstance(model, Designer):
            return model.design(problem)
        return optimise_all([problem], model)[0]
    except NotConverged as reason:
        return reason


def row_of(problem: Problem, found: Design | NotConverged) -> Row:
    """Return a problem's Reynolds number and its optimum as a row; without one "why_not" says why.

    Coefficients are by the problem's reference length, "reynolds" and "onset" by D, "chord" and
    "thickness" in D, "multipliers" of the objective (of the glide ratio -Cl / Cd). Where no
    optimum was found, the Reynolds number that depends on its chord is None.

    "flows" are those of this design alone, which used the flows of the designs before it.
    """
    nominal, by_chord = problem.objective.nominal, problem.by_chord
    row: Row = dict.fromkeys(OPTIMUM) | {"why_not": None}
    row["reynolds"] = None if by_chord else nominal
    row["chord_reynolds"] = nominal if by_chord else None
    if isinstance(found, NotConverged):
        return row | {"why_not": str(found)}
    return row | {
        "reynolds": found.reynolds,
        "chord_reynolds": found.chord_reynolds,
        "parameters": problem.scene.family.named(found.parameters),
        **{name: getattr(found, name) for name in OF_DESIGN},
        "cd": found.drag,
        "cl": found.lift,
        "cm": found.moment,
        "glide": found.lift / found.drag,
        "at_range_ends": problem.at_range_ends(found.variables),
    }


def designs_over(
    model: Surrogate | Designer,
    reynolds: Sequence[float],
    lengths: Sequence[float],
    progress: Update | None = None,
    **bounds: object,
) -> tuple[list[Row], float]:
    """Return the optimum at every Re and bound on the length as a row, and the wall seconds of all.

    Args:
      model: as for ``optima``.
      reynolds: Reynolds numbers.
      lengths: upper bounds on the chord, in D.
      progress: as for ``optima``.
      **bounds: other constraints of all bodies by their names in ``Problem``.

    Returns:
      Rows as of ``row_of`` by length, then Re, without a bound last; ``excess`` is the drag over
      that of the optimum without a bound on the length, minus 1. Then the wall seconds.

    Raises:
      InvalidInput: as ``optima``.
      NotConverged: at no Re there is an optimum without a bound on the length.
    """
    problems = [
        Problem(model.scene, re, length, **bounds) for length in (*lengths, None) for re in reynolds
    ]
    begin = time.perf_counter()
    found = optima(problems, model, progress)
    seconds = time.perf_counter() - begin
    expect_one(found[-len(reynolds) :])
    rows = [row_of(*pair) for pair in zip(problems, found, strict=True)]
    unbounded = {row["reynolds"]: row["cd"] for row in rows[-len(reynolds) :]}
    for row, problem in zip(rows, problems, strict=True):
        known = row["cd"], unbounded[row["reynolds"]]
        excess = None if None in known else known[0] / known[1] - 1
        row |= {"max_length": problem.max_length, "excess": excess}
    return rows, seconds
