"""Accuracy of the 3-D flow against elements, exact drags and the correlations of practice."""

import functools
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import numpy as np
from correlations import CORRELATIONS, ellipsoid, oberbeck
from elements import AXISYMMETRIC, FLATTENED, TINY_ELEMENTS, reference_cd, solve_by_elements
from meshes import Elements
from study import TINY, Result, Row, Run, Study, Table, columns, maps, place, values, words
from tools import mean_and_most, name_of, relative_error, solved

from surrogate import Family, Fidelity
from surrogate.flow.grid.wall_3d import THIN_LAYER_RE

# sphere, axisymmetric finite elements on finer meshes, uncertainty about 5e-5
SPHERE = {0.1: 244.176, 1.0: 27.3175, 10.0: 4.3079, 40.0: 1.7891, 100.0: 1.0881}
BETAS = {"beta2": (-0.3, 0.3), "beta3": (-0.15, 0.2), "beta4": (-0.1, 0.1)}
REVOLVED = Family(dimension=3, aspect=(0.5, 4.0), **BETAS)
RANGE = (0.1, 100.0)  # Re of held-out bodies
COUNT = 12  # of held-out bodies
CREEPING = 0.01  # Re at which ellipsoids are compared with Stokes flow
PRACTICE = ((0.5, 1.0), (1.0, 1.0), (2.0, 1.0), (4.0, 1.0), (2.0, 2.0))  # aspect, flatness
ELLIPSOIDS = (*PRACTICE, (2.0, 1.5), (1.0, 2.0), (0.7, 2.0), (4.0, 2.0))
NUMBERS = (0.1, 1.0, 10.0, 100.0)  # Re of correlations
HELD_OUT = "aspect; beta2, beta3, beta4; Re"
STUBBY = {"aspect": 0.5, "beta2": -0.2, "beta3": 0.15, "beta4": -0.1}
BLUNT = {"aspect": 0.6, "beta2": -0.25, "beta3": 0.15, "beta4": -0.08}
POINTED = {"aspect": 4.0, "beta2": -0.3}
WIDE = {"aspect": 2.5, "flatness": 2.0, "beta2": 0.2, "beta3": 0.1}
BROAD = {"aspect": 0.7, "flatness": 2.0, "beta2": -0.1}
FULL = {"aspect": 0.5, "beta2": 0.25, "beta3": 0.15, "beta4": 0.08}
LEAN = {"aspect": 4.0, "beta2": 0.2, "beta3": -0.1, "beta4": 0.05}
CORNERS = (
    *((STUBBY, 60.0), (STUBBY, 100.0), (BLUNT, 100.0), (FULL, 20.0), (LEAN, 5.0)),
    *((WIDE, 40.0), (BROAD, 10.0), (POINTED, 1.0), (POINTED, 10.0)),
)
FINER = Elements(order=3, box=14.0, wall=0.25, near=0.5, wake=1.2)  # round flattened bodies


def flows(run: Run) -> Iterator[Row]:
    """Yield the cases: sphere, ellipsoids, correlations, and held-out bodies of revolution."""
    names = ("draft", "standard", "fine")
    levels = [TINY] if run.tiny else [run.fidelity(name, 3) for name in names]
    usual, elements = levels[:2], run.pick(TINY_ELEMENTS, None)
    for re in run.pick([1.0], SPHERE):
        flow, column = ({"aspect": 1.0}, re), f"Re {re:g}"
        for level in levels:
            yield _flow("sphere", level.name, column, _by_flow, *flow, level, SPHERE[re])
        yield _flow("sphere", "finite elements", column, _by_elements, *flow, elements, SPHERE[re])
    for ratios in run.pick(PRACTICE[1:2], ELLIPSOIDS):
        at = f"ellipsoids, Re {CREEPING:g}", "aspect {:g}, flatness {:g}".format(*ratios)
        exact = partial(oberbeck, ellipsoid(*ratios), CREEPING)
        yield _flow(*at, "exact Cd", _error, exact)
        for level in usual:
            yield _flow(*at, level.name, _error, partial(_drag, ratios, CREEPING, level), exact)
    for ratios in run.pick(PRACTICE[1:2], PRACTICE):
        for re in run.pick([1.0], NUMBERS):
            at = "aspect {:g}, flatness {:g}".format(*ratios), f"Re {re:g}"
            drag = partial(_drag, ratios, re, usual[-1])
            yield _flow("Cd of the flow", *at, _error, drag)
            for name, formula in CORRELATIONS.items():
                yield _flow(name, *at, _error, partial(formula, ellipsoid(*ratios), re), drag)
    for k, (body, re) in enumerate(held_out()[: run.pick(1, None)]):
        row = "{aspect:.2f}; {beta2:+.2f}, {beta3:+.2f}, {beta4:+.2f}; {re:.3g}"
        at = HELD_OUT, row.format(re=re, **body)
        yield _flow(*at, "finite elements", _by_elements, body, re, elements)
        finest_too = k % 3 == 0 or re > THIN_LAYER_RE  # it takes minutes
        for level in levels if finest_too else usual:
            yield _flow(*at, level.name, _by_flow, body, re, level, None, elements)


def _flow(panel: str, row: str, column: str, measured: Callable[..., Row], *arguments: Any) -> Row:
    return place(panel, row, column) | {"measured": partial(measured, *arguments)}


def _error(cd: Callable[[], float], exact: Callable[[], float] = lambda: None) -> Row:
    return _row(cd(), exact())


def _by_elements(body, re: float, elements: Elements | None, exact: float | None = None) -> Row:
    found = solve_by_elements(AXISYMMETRIC, body, re, elements)
    return _row(found.cd, exact, seconds=found.seconds) | {"unknowns": found.unknowns}


def _by_flow(body, re: float, level: Fidelity, exact: float | None, elements=None) -> Row:
    """Return the error against an exact drag or elements, and seconds without compilation."""
    exact = exact or reference_cd(AXISYMMETRIC, body, re, elements)
    solved(body, re, level, 3)
    start = time.process_time()
    found = solved(body, re, level, 3)
    return _row(found.drag, exact, found.green_applications, time.process_time() - start)


@functools.cache
def _drag(ratios: tuple[float, float], re: float, level: Fidelity) -> float:
    return solved(ellipsoid_body(*ratios), re, level, 3).drag


def _row(cd, exact=None, work=None, seconds=None) -> Row:
    error = relative_error(cd, exact)
    return {"cd": cd, "error": error, "green_applications": work, "seconds": seconds}


def held_out() -> list[tuple[dict[str, float], float]]:
    """Return bodies of revolution: aspects and Re evenly in their logarithms, betas at random."""
    keys = jax.random.split(jax.random.key(3))
    bodies = np.array(REVOLVED.sample(keys[0], COUNT))
    aspect = REVOLVED.names.index("aspect")
    bodies[:, aspect] = np.geomspace(*REVOLVED.bounds[aspect], COUNT)
    numbers = jax.random.permutation(keys[1], np.geomspace(*RANGE, COUNT))
    return [(REVOLVED.named(body), float(re)) for body, re in zip(bodies, numbers, strict=True)]


def ellipsoid_body(aspect: float, flatness: float) -> dict[str, float]:
    """Return the parameters of the family, by name, of an ellipsoid."""
    return {"aspect": aspect} | ({} if flatness == 1 else {"flatness": flatness})


def cell(row: Row) -> str:
    """Return the text of a cell: error, or Cd where there is none; work and time where known."""
    form = "{cd:.4g}" if row["error"] is None else "{error:+.2%}"
    form += ", {green_applications} G" if row["green_applications"] else ""
    return words(form + (" in {seconds:.1f} s" if row["seconds"] else ""), **row)


def flow_text(result: Result) -> str:
    """Return the mean and largest errors of the held-out bodies and of the correlations as text."""
    rows = [row for row in result["rows"] if row["error"] is not None]
    bodies = [row for row in rows if row["panel"] == HELD_OUT]
    levels = [[row for row in bodies if row["column"] == n] for n in values(bodies, "column")]
    formulas = [[row for row in rows if row["panel"] == name] for name in CORRELATIONS]
    form = "Errors of the held-out bodies, mean and largest: {}. Of the correlations: {}."
    levels = (_summary("{column} {off[0]:.2%} and {off[1]:.2%}", mine) for mine in levels)
    formulas = (_summary("{panel} {off[0]:.0%} and {off[1]:.0%}", mine) for mine in formulas)
    return form.format(", ".join(levels), ", ".join(formulas))


def _summary(form: str, rows: list[Row]) -> str:
    return words(form, **rows[0], off=mean_and_most(row["error"] for row in rows))


def corners(run: Run) -> Iterator[Row]:
    """Yield corners of the family with the largest errors, and wide bodies, on two fidelities."""
    for body, re in CORNERS:
        for name in ("draft", "standard"):
            yield {"body": name_of(body), "re": re, "fidelity": name, "parameters": body}


def corner(run, parameters, re, fidelity, **_) -> Row:
    """Return the error against elements, beside the estimated error and the status.

    Args:
      run: How the study is run.
      parameters: Of the body, by name.
      re: U D / nu.
      fidelity: Name of the fidelity.
      **_: The rest of the case.
    """
    level = run.fidelity(fidelity, 3)
    found = solved(parameters, re, level, 3, estimate=True)
    geometry, elements = AXISYMMETRIC, run.pick(TINY_ELEMENTS, None)
    if "flatness" in parameters:
        geometry, elements = FLATTENED, FINER
    error = found.drag / reference_cd(geometry, parameters, re, elements) - 1
    row = {"tolerance": level.tolerance, "estimate": found.estimated_error, "status": found.status}
    row["expected"] = found.expected_error
    return row | {"error": error}


def fine_flows(run: Run) -> Iterator[Row]:
    """Yield the sphere, ellipsoids and held-out bodies, with their exact Cd where it is known."""
    known = [({"aspect": 1.0}, re, exact) for re, exact in SPHERE.items() if not run.tiny or re > 9]
    for ratios in ELLIPSOIDS:
        exact = oberbeck(ellipsoid(*ratios), CREEPING)
        known.append((ellipsoid_body(*ratios), CREEPING, exact))
    for body, re, exact in [*known, *((*one, None) for one in held_out())]:
        yield {"body": name_of(body, ".2f"), "re": re, "parameters": body, "exact": exact}


def extrapolation(run, parameters, re, exact, **_) -> Row:
    """Return the errors of the drag and of the extrapolated drag.

    They are against the exact drag, or that of elements where it is not known.

    Args:
      run: How the study is run.
      parameters: Of the body, by name.
      re: U D / nu.
      exact: Its Cd, or None for that of the elements.
      **_: The rest of the case.
    """
    found = solved(parameters, re, run.fidelity("fine", 3), 3, estimate=True)
    exact = exact or reference_cd(AXISYMMETRIC, parameters, re, run.pick(TINY_ELEMENTS, None))
    errors = {
        "error": relative_error(found.drag, exact),
        "extrapolated": relative_error(found.extrapolated_drag, exact),
    }
    return errors | {"estimate": found.estimated_error, "status": found.status}


def extrapolation_text(result: Result) -> str:
    """Return the mean and largest errors of the drag and of the extrapolated drag as text."""
    drag, limit = (
        mean_and_most(row[key] for row in result["rows"]) for key in ("error", "extrapolated")
    )
    form = "Error of the drag: {drag[0]:.2%} on average, {drag[1]:.2%} at most; of the extrapolated"
    return words(form + " drag: {limit[0]:.2%} and {limit[1]:.2%}.", drag=drag, limit=limit)


CORNER = columns(
    "body {body} | Re {re:g} | fidelity {fidelity} | error against elements {error:+.2%}"
    " | error tolerance {tolerance:.2%} | estimated error {estimate:.2%} | status {status}"
)
EXTRAPOLATION = columns(
    "body {body} | Re {re:.3g} | error of the drag {error:+.2%}"
    " | of the extrapolated drag {extrapolated:+.2%} | estimated error {estimate:.2%}"
    " | status {status}"
)
FLOWS = Table(flows, lambda run, measured, **_: measured(), maps(cell), tiny="all")
STUDIES = {
    "flow_3d": Study([FLOWS], flow_text),
    "corners": Study([Table(corners, corner, CORNER)]),
    "extrapolated": Study([Table(fine_flows, extrapolation, EXTRAPOLATION)], extrapolation_text),
}
