"""The estimated error of a flow, from a coarser grid and from a smaller domain.

Notes with the formulas and their evidence are in ``surrogate/flow/README.md``.
"""

import abc
import dataclasses
import math
from collections.abc import Callable
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.grid.wall_3d import thin_layer
from surrogate.scene.fidelity import NAMED, Fidelity

SAFETY = 2.5  # bound over likely error; Roache (1994): 3 of two grids, 1.25 of three
ASYMPTOTIC_CELLS = 16  # per D, from which the grid's error falls at its order


class ErrorEstimate(NamedTuple):
    """The estimated error of a flow.

    Attributes:
      status: "unknown" where no estimate was asked for; "accurate" where the drag's likely error,
        in 3-D with a margin, is within the fidelity's tolerance; "degraded" where it is not, where
        no coarser flow could be solved, or where the body is taller than any that the tolerance
        was tested on.
      estimated_error: relative bound of the drag's error, ``SAFETY`` times the likely one; None
        where no coarser flow exists.
      estimated_lift_error: the same of the lift coefficient itself.
      sufficient: the name of a fidelity that should meet the tolerance of a degraded flow, if any.
      extrapolated_drag: limit of the two grids' drags (Richardson 1911); None where the coarser
        grid has too few cells. Of the named fidelities only fine has one.
    """

    status: Literal["accurate", "degraded", "unknown"] = "unknown"
    estimated_error: float | None = None
    estimated_lift_error: float | None = None
    sufficient: str | None = None
    extrapolated_drag: float | None = None


class DragAndLift(NamedTuple):
    """Cd and Cl of one body at one fidelity."""

    drag: float
    lift: float


@dataclasses.dataclass(frozen=True)
class ErrorModel(abc.ABC):
    """How errors depend on the grid and on the domain, in 2-D or in 3-D.

    ``GROWTH`` and ``SAFETY`` together make bounds that cover errors of grid and domain (studies
    ``trust``, ``trust_space``). The domain's errors alone, which change sign with its size, are
    covered by about half only (study ``constants``).
    """

    SMALLER: ClassVar[float]  # domain of the estimate, as a share of the whole
    GROWTH: ClassVar[float]  # by which the domain's error is greater there
    TALLEST: ClassVar[float]  # D across the stream, the tallest body of the tests of tolerances

    @abc.abstractmethod
    def order(self, reynolds: float) -> float:
        """Return the power of the cell size that the grid's error falls with."""

    @abc.abstractmethod
    def margin(self, cells: int, reynolds: float) -> float:
        """Return the multiple of the likely error that must be within the tolerance."""


class ErrorModel2D(ErrorModel):
    """Second order in the cell size."""

    SMALLER, GROWTH, TALLEST = 2 / 3, 3.0, 1.5

    def order(self, reynolds: float) -> float:
        return 2.0

    def margin(self, cells: int, reynolds: float) -> float:
        return 1.0


class ErrorModel3D(ErrorModel):
    """Third order where the slip law holds, second where boundary layers thin to few cells."""

    SMALLER, GROWTH, TALLEST = 5 / 6, 5.0, 1.65  # bodies allow no smaller domain
    FEW_CELLS = 1.5  # margin on grids of few cells, on which errors reach that multiple

    def order(self, reynolds: float) -> float:
        return 3.0 - thin_layer(reynolds)

    def margin(self, cells: int, reynolds: float) -> float:
        margin = 1.0 if cells >= ASYMPTOTIC_CELLS else self.FEW_CELLS
        return margin + (SAFETY - margin) * thin_layer(reynolds)


ERROR_MODELS: dict[int, ErrorModel] = {2: ErrorModel2D(), 3: ErrorModel3D()}


def estimate_error(
    forces: DragAndLift,
    solve: Callable[[Fidelity], DragAndLift],
    fidelity: Fidelity,
    reynolds: float,
    height: float,
    dimension: int,
) -> ErrorEstimate:
    """Estimate the errors of the forces on a body, at two thirds of their own cost.

    Args:
      forces: of the body at this fidelity.
      solve: gives those of the same body at another fidelity.
      fidelity: of the flow whose error is estimated.
      reynolds: U D / nu.
      height: of the body across the stream, in D.
      dimension: 2 or 3.
    """
    model = ERROR_MODELS[dimension]
    fitted = fidelity.for_wake(reynolds, height)
    try:
        coarser = dataclasses.replace(fitted.coarser(), wake=0.0)
        rough, cramped = solve(coarser), solve(coarser.smaller(model.SMALLER))
    except (InvalidInput, NotConverged):
        return ErrorEstimate("degraded")
    order = model.order(reynolds)
    growth = (fitted.cells / coarser.cells) ** order - 1
    of_grid = [abs(a - b) / growth for a, b in zip(rough, forces, strict=True)]
    of_domain = [abs(a - b) / (model.GROWTH - 1) for a, b in zip(cramped, rough, strict=True)]
    likely, likely_lift = np.add(of_grid, of_domain).tolist()  # added up, lest they cancel
    errors = SAFETY * likely / forces.drag, SAFETY * likely_lift
    limit = forces.drag + (forces.drag - rough.drag) / growth
    extrapolated = limit if coarser.cells >= ASYMPTOTIC_CELLS else None
    allowed = fidelity.promise * forces.drag / model.margin(coarser.cells, reynolds)
    if height > model.TALLEST:
        return ErrorEstimate("degraded", *errors, None, extrapolated)
    if likely <= allowed:
        return ErrorEstimate("accurate", *errors, None, extrapolated)

    def likely_at(level):
        grid = of_grid[0] * (fitted.cells / level.cells) ** order
        return grid + of_domain[0] * _domain_error(fitted, level.for_wake(reynolds, height), model)

    levels = NAMED[dimension].values()
    sufficient = next((level.name for level in levels if likely_at(level) <= allowed), None)
    return ErrorEstimate("degraded", *errors, sufficient, extrapolated)


def _domain_error(fitted, level, model):
    """Return the domain's error at another level over that of the fitted fidelity."""
    sizes = ("upstream", "downstream", "height")
    larger = min(getattr(level, name) / getattr(fitted, name) for name in sizes)
    return larger ** (math.log(model.GROWTH) / math.log(model.SMALLER))
