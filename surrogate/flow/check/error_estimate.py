"""The estimated error of a flow, from a coarser grid and from another domain.

Notes with the formulas and their evidence are in ``surrogate/flow/README.md``.
"""

import dataclasses
import math
import operator
from collections.abc import Callable
from typing import Literal, NamedTuple

from surrogate.errors import InvalidInput, NotConverged, TooLarge
from surrogate.flow.check.error_model import ASYMPTOTIC_CELLS, ERROR_MODELS, Loads
from surrogate.scene.fidelity import NAMED, Fidelity
from surrogate.scene.limits import ROUNDING

LOAD_TOLERANCE = 2.5  # tolerance of errors of Cl and Cm over Cd, as a multiple of that of Cd
NO_LIFT = 1e-5  # Cl and Cm over Cd up to which a flow is symmetric, but for the solver's tolerance
COARSE = "no coarser grid resolves the body's flow"
ELSEWHERE = "the body's flow was not found in the other domain of the estimate"
NO_NUMBER = "its estimated error is no finite number"
TOO_LARGE = "the body is too large for the other domain of the estimate"
TALL = "taller than the bodies of its tests"
FLAT = "flatter than the bodies of its tests"  # in 3-D, wider than high or higher than wide
FLATTEST = 2.0  # ratio of width and height, or of height and width, in these tests


class ErrorEstimate(NamedTuple):
    """The estimated error of a flow.

    Attributes:
      status: "unknown" where no estimate was asked for; "accurate" where the drag's expected error
        is within the fidelity's tolerance, and those of Cl and Cm are within 2.5 times it, over Cd;
        "degraded" where they are not, where no coarser flow could be solved, or where the body is
        taller or flatter than any that the tolerance was tested on.
      expected_error: relative error of the drag that is expected, in 3-D with a margin; None where
        no coarser flow exists.
      estimated_error: relative bound of the drag's error, made to cover 95 % of the errors.
      estimated_lift_error: bound of the error of Cl itself, made to cover 95 % of the errors.
      estimated_moment_error: bound of the error of Cm itself, as that of Cl.
      sufficient: the name of a fidelity that should meet the tolerance of a degraded flow, if any.
      extrapolated_drag: limit of the two grids' drags (Richardson 1911), by the fitted share of
        the grid's error; None where the coarser grid has less than 16 cells per D.
      cause: of a degraded flow: which load is expected to err by too much, that the body is too
        tall or too flat, or which of the two flows of the estimate was not found.
    """

    status: Literal["accurate", "degraded", "unknown"] = "unknown"
    expected_error: float | None = None
    estimated_error: float | None = None
    estimated_lift_error: float | None = None
    estimated_moment_error: float | None = None
    sufficient: str | None = None
    extrapolated_drag: float | None = None
    cause: str = ""


def estimate_error(
    loads: Loads,
    solve: Callable[[Fidelity], Loads],
    fidelity: Fidelity,
    reynolds: float,
    height: float,
    dimension: int,
    nose: float,
    onset: float,
    fewest: int = 0,
    flatness: float = 1.0,
) -> ErrorEstimate:
    """Estimate the errors of the loads on a body, from two more flows on a coarser grid.

    These cost about two thirds of the flow itself.

    Args:
      loads: of the body at this fidelity.
      solve: gives those of the same body at another fidelity.
      fidelity: of the flow whose error is estimated, with the domain of that flow.
      reynolds: U D / nu.
      height: of the body across the stream, in D.
      dimension: 2 or 3.
      nose: radius of curvature in D that its boundary layers follow (``Shape.nose``).
      onset: Re of the body's onset of instability in an unbounded stream.
      fewest: cells per D that resolve the body; grids that are not coarser have no estimate.
      flatness: width over height of a 3-D body; modes around it that are left out have the same
        error on all grids.
    """
    model = ERROR_MODELS[dimension]
    whole = dataclasses.replace(fidelity, wake=0.0, refinement=1.0)  # they have been applied
    missing = COARSE
    try:
        coarser = whole.coarser(model.COARSER, fewest)
        rough, missing = solve(coarser), ELSEWHERE
        other = solve(coarser.scaled(model.OTHER_DOMAIN))
    except (InvalidInput, NotConverged) as problem:
        large = missing == ELSEWHERE and isinstance(problem, TooLarge)
        return ErrorEstimate("degraded", cause=TOO_LARGE if large else missing)
    order = model.order(reynolds)
    growth = (whole.cells / coarser.cells) ** order - 1
    of_grid = [(a - b) / growth / loads.drag for a, b in zip(rough, loads, strict=True)]
    step = (1 - model.DOMAIN_ERROR) * loads.drag
    of_domain = [(a - b) / step for a, b in zip(rough, other, strict=True)]
    margin = model.margin(coarser.cells, reynolds)

    def likely_at(cells, grid, domain):
        errors = model.likely(Loads(*grid), Loads(*domain), model.spreads(cells, reynolds, nose))
        return Loads(*map(operator.mul, errors, model.onset_factors(reynolds / onset)))

    likely = likely_at(whole.cells, of_grid, of_domain)
    if not all(map(math.isfinite, likely)):
        return ErrorEstimate("degraded", cause=NO_NUMBER)
    expected = Loads(*(margin * each for each in likely))
    parts = zip(model.SAFETY, likely, expected, strict=True)
    bounds = [max(safety * each, most) for safety, each, most in parts]
    resolved = coarser.cells >= ASYMPTOTIC_CELLS
    limit = loads.drag * (1 - model.GRID_SHARE * of_grid[0]) if resolved else None
    lifting = max(abs(loads.lift), abs(loads.moment)) > NO_LIFT * loads.drag
    size = loads.drag if lifting else 0.0  # of symmetric flows lift and moment are exact
    known = expected.drag, bounds[0], *(size * bound for bound in bounds[1:])
    if height > model.TALLEST:
        return ErrorEstimate("degraded", *known, None, limit, TALL)
    if max(flatness, 1 / flatness) > FLATTEST * (1 + ROUNDING):
        return ErrorEstimate("degraded", *known, None, limit, FLAT)
    tolerances = load_tolerances(fidelity.tolerance)
    if not lifting:
        tolerances = tolerances._replace(lift=math.inf, moment=math.inf)
    if not (cause := _excess(expected, tolerances)):
        return ErrorEstimate("accurate", *known, None, limit)

    def expected_at(level):
        level = level.for_body(reynolds, height, nose)
        finer = (whole.cells / level.cells) ** order
        larger = _domain_error(whole, level, model)
        grid, domain = (finer * g for g in of_grid), (larger * d for d in of_domain)
        return Loads(*(margin * each for each in likely_at(level.cells, grid, domain)))

    levels = NAMED[dimension].values()
    enough = (level.name for level in levels if not _excess(expected_at(level), tolerances))
    return ErrorEstimate("degraded", *known, next(enough, None), limit, cause)


def load_tolerances(tolerance: float) -> Loads:
    """Return the tolerances of the errors of Cd, Cl and Cm over Cd by that of the drag."""
    return Loads(tolerance, LOAD_TOLERANCE * tolerance, LOAD_TOLERANCE * tolerance)


def _excess(expected, tolerances):
    """Return which load is expected to err by more than its tolerance; empty if none is."""
    for symbol, error, most in zip(("Cd", "Cl", "Cm"), expected, tolerances, strict=True):
        if error > most:
            return f"{symbol} expected to err by {100 * error:.3g} % of Cd, over {100 * most:.3g} %"
    return ""


def _domain_error(whole, level, model):
    """Return the domain's error at another level over that of the own fidelity."""
    sizes = ("upstream", "downstream", "height")
    larger = min(getattr(level, name) / getattr(whole, name) for name in sizes)
    return larger ** (math.log(model.DOMAIN_ERROR) / math.log(model.OTHER_DOMAIN))


def accuracy_text(
    status: str,
    expected: float | None,
    bound: float | None,
    tolerance: float,
    sufficient: str | None = None,
    cause: str = "",
) -> str:
    """Return in words whether a flow meets its tolerance, such as "meets 0.4 % (expected ...)".

    Args:
      status: "accurate", "degraded", or "unknown" without an estimate.
      expected: expected relative error of the drag, if known.
      bound: relative bound of the drag's error, if known.
      tolerance: relative error tolerance of the fidelity.
      sufficient: name of a fidelity that should meet this tolerance, if any.
      cause: why it is degraded although the drag's expected error is within the tolerance, or not
        known.
    """
    wanted = f"{100 * tolerance:g} %"
    if status == "unknown":
        return "error not estimated"
    if expected is None or bound is None:
        return f"not known to meet {wanted}: {cause or COARSE}"
    sizes = f"expected {100 * expected:.2g} %, bound {100 * bound:.2g} %"
    remedy = f"; {sufficient} would do" if sufficient else ""
    if status == "accurate":
        return f"meets {wanted} ({sizes})"
    if expected <= tolerance:
        return f"not known to meet {wanted}: {cause} ({sizes}{remedy})"
    return f"does not meet {wanted} ({sizes}{remedy})"
