"""How far a drag can be trusted: the same body on a coarser grid, and in a smaller window."""

import dataclasses
from typing import Literal, NamedTuple

import numpy as np

from surrogate.body import Shape
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.domain import Domain
from surrogate.flow.drag import DragReport, body_domain, report
from surrogate.scene import Fidelity, Stream

NODES_TO_FIT = 400
TALLEST = 1.5  # D across the stream: beyond, no promise was measured


class Trust(NamedTuple):
    """``estimated_error`` of the drag, relative; None where the coarser flow does not exist.

    ``accurate`` says that it is within what the fidelity promises, ``degraded`` that it is not,
    that there is no estimate, or that the body is taller than any the promise was measured on.
    """

    estimated_error: float | None
    status: Literal["accurate", "degraded"]


def fitted_domain(shape: Shape, stream: Stream, fidelity: Fidelity, reynolds: float) -> Domain:
    """Grid and window for a body.

    Raises:
      InvalidInput: the body does not fit grid or stream.
    """
    outline = shape.draw(NODES_TO_FIT)
    return body_domain(stream, fidelity, outline, shape.symmetric, reynolds)


def solve_shape(
    shape: Shape, stream: Stream, fidelity: Fidelity, reynolds: float, gradient: bool = False
) -> DragReport:
    """Drag of a body on a grid and window fit for it; the ``gradient`` is for family bodies.

    Raises:
      InvalidInput: as ``fitted_domain``.
      NotConverged: the flow was not found.
    """
    domain = fitted_domain(shape, stream, fidelity, reynolds)
    parameters = np.array(shape.parameters) if gradient else None
    return report(domain, shape.draw(domain.nodes), reynolds, parameters)


def judge(drag: float, shape: Shape, stream: Stream, fidelity: Fidelity, reynolds: float) -> Trust:
    """Estimate the error of a drag that ``solve_shape`` found, at two thirds of its cost.

    The scheme is of second order, so with two thirds of the cells the error of the grid is 9/4 of
    it; in two thirds of the window that of the window is about three times as large. The two are
    added up, lest they cancel.
    """
    height = float(np.ptp(shape.draw(NODES_TO_FIT)[:, 1]))
    fitted = fidelity.reaching(reynolds, height)
    coarser = dataclasses.replace(fitted.coarser(), wake=0.0)
    try:
        rough, cramped = (
            solve_shape(shape, stream, level, reynolds).cd for level in (coarser, coarser.smaller())
        )
    except (InvalidInput, NotConverged):
        return Trust(None, "degraded")
    of_grid = abs(rough - drag) / ((fitted.cells / coarser.cells) ** 2 - 1)
    error = (of_grid + abs(cramped - rough) / 2) / drag
    within = error <= fidelity.promise and height <= TALLEST
    return Trust(error, "accurate" if within else "degraded")
