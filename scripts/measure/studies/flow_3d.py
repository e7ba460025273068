"""Error of the flow in 3-D: against elements, exact drags and the correlations of practice."""

import functools
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import numpy as np
from correlations import CORRELATIONS, ellipsoid, oberbeck
from elements import AXISYMMETRIC, TINY_ELEMENTS, reference_cd, solve_by_elements
from meshes import Elements
from study import TINY, Result, Row, Run, Study, Table, maps, place, values, words
from tools import mean_and_most, relative_error, solved

from surrogate import Family, Fidelity
from surrogate.flow.grid.immersed import THIN

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


def cases(run: Run) -> Iterator[Row]:
    """The sphere, ellipsoids, correlations, and held-out bodies of revolution."""
    names = ("draft", "standard", "fine")
    levels = [TINY] if run.tiny else [run.fidelity(name, 3) for name in names]
    usual, elements = levels[:2], run.pick(TINY_ELEMENTS, None)
    for re in run.pick([1.0], SPHERE):
        flow, column = ({"aspect": 1.0}, re), f"Re {re:g}"
        for level in levels:
            yield _case("sphere", level.name, column, _by_flow, *flow, level, SPHERE[re])
        yield _case("sphere", "finite elements", column, _by_elements, *flow, elements, SPHERE[re])
    for ratios in run.pick(PRACTICE[1:2], ELLIPSOIDS):
        at = f"ellipsoids, Re {CREEPING:g}", "aspect {:g}, flatness {:g}".format(*ratios)
        exact = oberbeck(ellipsoid(*ratios), CREEPING)
        yield _case(*at, "exact Cd", _error, lambda cd=exact: cd)
        for level in usual:
            drag = partial(_drag, ratios, CREEPING, level)
            yield _case(*at, level.name, _error, drag, lambda cd=exact: cd)
    for ratios in run.pick(PRACTICE[1:2], PRACTICE):
        for re in run.pick([1.0], NUMBERS):
            at = "aspect {:g}, flatness {:g}".format(*ratios), f"Re {re:g}"
            drag = partial(_drag, ratios, re, usual[-1])
            yield _case("Cd of the flow", *at, _error, drag)
            for name, formula in CORRELATIONS.items():
                yield _case(name, *at, _error, partial(formula, ellipsoid(*ratios), re), drag)
    for k, (body, re) in enumerate(held_out()[: run.pick(1, None)]):
        row = "{aspect:.2f}; {beta2:+.2f}, {beta3:+.2f}, {beta4:+.2f}; {re:.3g}"
        at = HELD_OUT, row.format(re=re, **body)
        yield _case(*at, "finite elements", _by_elements, body, re, elements)
        for level in levels if k % 3 == 0 or re > THIN else usual:  # the finest takes minutes
            yield _case(*at, level.name, _by_flow, body, re, level, None, elements)


def _case(panel: str, row: str, column: str, measured: Callable[..., Row], *arguments: Any) -> Row:
    return place(panel, row, column) | {"measured": partial(measured, *arguments)}


def _error(cd: Callable[[], float], exact: Callable[[], float] = lambda: None) -> Row:
    return _row(cd(), exact())


def _by_elements(body, re: float, elements: Elements | None, exact: float | None = None) -> Row:
    found = solve_by_elements(AXISYMMETRIC, body, re, elements)
    return _row(found.cd, exact, seconds=found.seconds) | {"unknowns": found.unknowns}


def _by_flow(body, re: float, level: Fidelity, exact: float | None, elements=None) -> Row:
    """Against an exact drag or elements, with processor seconds without compilation."""
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
    """Bodies of revolution: aspects and Re evenly in their logarithms, betas at random."""
    keys = jax.random.split(jax.random.key(3))
    bodies = np.array(REVOLVED.sample(keys[0], COUNT))
    bodies[:, 0] = np.geomspace(*REVOLVED.bounds[0], COUNT)
    numbers = jax.random.permutation(keys[1], np.geomspace(*RANGE, COUNT))
    return [(REVOLVED.named(body), float(re)) for body, re in zip(bodies, numbers, strict=True)]


def ellipsoid_body(aspect: float, flatness: float) -> dict[str, float]:
    """Parameters of the family."""
    return {"aspect": aspect} | ({} if flatness == 1 else {"flatness": flatness})


def cell(row: Row) -> str:
    """Error, or Cd where there is none; work and time where they were taken."""
    form = "{cd:.4g}" if row["error"] is None else "{error:+.2%}"
    form += ", {green_applications} G" if row["green_applications"] else ""
    return words(form + (" in {seconds:.1f} s" if row["seconds"] else ""), **row)


def text(result: Result) -> str:
    """Mean and largest errors of the held-out bodies and of the correlations."""
    rows = [row for row in result["rows"] if row["error"] is not None]
    bodies = [row for row in rows if row["panel"] == HELD_OUT]
    levels = [[row for row in bodies if row["column"] == n] for n in values(bodies, "column")]
    form = "{column}: {mean:.2%} on average, {most:.2%} at most"
    parts = [f"Errors of the held-out bodies: {'; '.join(_summary(form, x) for x in levels)}."]
    formulas = [[row for row in rows if row["panel"] == name] for name in CORRELATIONS]
    form = "{panel}: {mean:.0%} on average, {most:.0%} at most"
    parts.append(f"Errors of the correlations: {'; '.join(_summary(form, x) for x in formulas)}.")
    return "\n\n".join(parts)


def _summary(form: str, rows: list[Row]) -> str:
    mean, most = mean_and_most(row["error"] for row in rows)
    return words(form, **rows[0] | {"mean": mean, "most": most})


def measure(run: Run, measured: Callable[[], Row], **_: Any) -> Row:
    """Cd, error, work and time."""
    return measured()


STUDY = Study([Table(cases, measure, maps(cell), tiny="all")], text)
