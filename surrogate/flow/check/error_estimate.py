"""How far a drag can be trusted: the same body on a coarser grid, and in a smaller window."""

import dataclasses
import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.grid.immersed import thinned
from surrogate.scene.fidelity import NAMED, Fidelity

SAFETY = 2.5  # estimates over likely errors: Roache (1994) takes 3 of two grids, 1.25 of three
ORDERLY = 16  # cells per D from which on the error of the grid falls as it should
FEWER = 1.5  # times the likely error in space, of fewer: what must be within the promise
TALLEST = {2: 1.5, 3: 1.65}  # D across the stream: beyond, no promise was measured


class Cramped(NamedTuple):
    """A smaller window, as a share of the whole, and by how much its error is the greater."""

    share: float
    error: float


CRAMPED = {2: Cramped(2 / 3, 3.0), 3: Cramped(5 / 6, 5.0)}  # in space bodies allow no less


class ErrorEstimate(NamedTuple):
    """How far a flow can be trusted; without an estimate ``status`` is "unknown".

    ``estimated_error`` of the drag is relative, ``estimated_lift_error`` that of the lift
    coefficient itself; None where the coarser flow does not exist. They are so large that they
    cover nearly every error: ``SAFETY`` times what is likely. ``accurate`` says that the drag's
    likely error, in space with a margin, is within what the fidelity promises, ``degraded`` that
    it is not, that there is no estimate, or that the body is taller than any the promise was
    measured on. ``sufficient`` names the fidelity that should keep the promise of a degraded one,
    where there is one.
    ``extrapolated_drag`` is what the two grids tend to (Richardson 1911), None where the coarser
    one has too few cells for it: of the named fidelities fine alone has one.
    The estimated error is that of the drag itself.
    """

    status: Literal["accurate", "degraded", "unknown"] = "unknown"
    estimated_error: float | None = None
    estimated_lift_error: float | None = None
    sufficient: str | None = None
    extrapolated_drag: float | None = None


class Forces(NamedTuple):
    """Coefficients of one body at one fidelity."""

    drag: float
    lift: float


def estimate_error(
    forces: Forces,
    solve: Callable[[Fidelity], Forces],
    fidelity: Fidelity,
    reynolds: float,
    height: float,
    dimension: int,
) -> ErrorEstimate:
    """Estimate the errors of the forces on a body of this height, at two thirds of their cost.

    ``solve`` gives those of the same body at another fidelity. The scheme is of second order, so
    with two thirds of the cells the error of the grid is 9/4 of it, or in space up to 27/8; how
    much greater that of a smaller window is was measured. The two are added up, lest they cancel.
    """
    window = CRAMPED[dimension]
    fitted = fidelity.reaching(reynolds, height)
    coarser = dataclasses.replace(fitted.coarser(), wake=0.0)
    try:
        rough, cramped = solve(coarser), solve(coarser.smaller(window.share))
    except (InvalidInput, NotConverged):
        return ErrorEstimate("degraded")
    falls = order(reynolds, dimension)
    growth = (fitted.cells / coarser.cells) ** falls - 1
    of_grid = [abs(a - b) / growth for a, b in zip(rough, forces, strict=True)]
    of_window = [abs(a - b) / (window.error - 1) for a, b in zip(cramped, rough, strict=True)]
    likely, lift = np.add(of_grid, of_window).tolist()
    errors = SAFETY * likely / forces.drag, SAFETY * lift
    tends = forces.drag + (forces.drag - rough.drag) / growth
    extrapolated = tends if coarser.cells >= ORDERLY else None
    allowed = fidelity.promise * forces.drag / _margin(coarser.cells, reynolds, dimension)
    if likely <= allowed and height <= TALLEST[dimension]:
        return ErrorEstimate("accurate", *errors, extrapolated_drag=extrapolated)
    finer = (
        level.name
        for level in NAMED[dimension].values()
        if of_grid[0] * (fitted.cells / level.cells) ** falls
        + of_window[0] * _left(fitted, level.reaching(reynolds, height), window)
        <= allowed
    )
    sufficient = next(finer, None) if height <= TALLEST[dimension] else None
    return ErrorEstimate("degraded", *errors, sufficient, extrapolated)


def order(reynolds: float, dimension: int) -> float:
    """Power of the cells' size that the error of the grid goes with; in space it was measured."""
    return 2.0 if dimension == 2 else 3.0 - thinned(reynolds)


def _margin(cells, reynolds, dimension):
    """Times its likely error that must be within the promise.

    In space the error has been up to 1.5 times the likely one of few cells, and twice that where
    boundary layers are thin.
    """
    if dimension == 2:
        return 1.0
    margin = 1.0 if cells >= ORDERLY else FEWER
    return margin + (SAFETY - margin) * thinned(reynolds)


def _left(fitted, level, window):
    """Share of the window's error that the window of another level leaves."""
    reaches = ("upstream", "downstream", "height")
    larger = min(getattr(level, name) / getattr(fitted, name) for name in reaches)
    return larger ** (math.log(window.error) / math.log(window.share))
