"""How far a drag can be trusted: the same body on a coarser grid, and in a smaller window."""

import dataclasses
from collections.abc import Callable
from typing import Literal, NamedTuple

from surrogate.errors import InvalidInput, NotConverged
from surrogate.scene.fidelity import Fidelity

TALLEST = 1.5  # D across the stream: beyond, no promise was measured


class Cramped(NamedTuple):
    """A smaller window, as a share of the whole, and by how much its error is the greater."""

    share: float
    error: float


CRAMPED = {2: Cramped(2 / 3, 3.0), 3: Cramped(5 / 6, 5.0)}  # in space bodies allow no less


class Trust(NamedTuple):
    """``estimated_error`` of the drag, relative; None where the coarser flow does not exist.

    ``accurate`` says that it is within what the fidelity promises, ``degraded`` that it is not,
    that there is no estimate, or that the body is taller than any the promise was measured on.
    ``green_applications`` is what the estimate took.
    """

    estimated_error: float | None
    status: Literal["accurate", "degraded"]
    green_applications: int


def judge(
    drag: float,
    solve: Callable[[Fidelity], tuple[float, int]],
    fidelity: Fidelity,
    reynolds: float,
    height: float,
    window: Cramped,
) -> Trust:
    """Estimate the error of the drag of a body of this height, at two thirds of its cost.

    ``solve`` gives drag and applications of G of the same body at another fidelity. The scheme is
    of second order, so with two thirds of the cells the error of the grid is 9/4 of it; how much
    greater that of a smaller ``window`` is was measured. The two are added up, lest they cancel.
    """
    fitted = fidelity.reaching(reynolds, height)
    coarser = dataclasses.replace(fitted.coarser(), wake=0.0)
    try:
        (rough, some), (cramped, more) = solve(coarser), solve(coarser.smaller(window.share))
    except (InvalidInput, NotConverged):
        return Trust(None, "degraded", 0)
    of_grid = abs(rough - drag) / ((fitted.cells / coarser.cells) ** 2 - 1)
    of_window = abs(cramped - rough) / (window.error - 1)
    error = (of_grid + of_window) / drag
    within = error <= fidelity.promise and height <= TALLEST
    return Trust(error, "accurate" if within else "degraded", some + more)
