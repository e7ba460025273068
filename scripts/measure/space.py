"""How right the flow is in space: against elements, exact drags and the correlations of practice.

python scripts/measure/space.py

The elements need NGSolve: pip install -e '.[bench]'.
"""

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from axisymmetric import ELEMENTS, solve_by_axisymmetric_elements
from correlations import CORRELATIONS, ellipsoid, oberbeck
from elements import Elements
from maps import Field, map_tables
from study import TINY, Result, Study, run_study, words

from surrogate import Family, Fidelity, Flow, InvalidInput, Scene, Solution, family_shape
from surrogate.flow.grid.wall_3d import THIN_LAYER_RE

# sphere, axisymmetric finite elements on finer meshes, uncertainty about 5e-5
SPHERE = {0.1: 244.176, 1.0: 27.3175, 10.0: 4.3079, 40.0: 1.7891, 100.0: 1.0881}
BETAS = {"beta2": (-0.3, 0.3), "beta3": (-0.15, 0.2), "beta4": (-0.1, 0.1)}
REVOLVED = Family(dimension=3, aspect=(0.5, 4.0), **BETAS)
NUMBERS = (0.1, 100.0)  # Re of held-out bodies
CREEPING = 0.01  # Re that ellipsoids in Stokes flow are solved at
HELD_OUT = "aspect; beta2, beta3, beta4; Re"
SEED = 3
COARSE = Elements(order=2, box=10.0, wall=0.2, near=0.5)  # of tiny measurements
Ratios = tuple[float, float]  # aspect, flatness
Fields = Iterator[dict[str, Any]]


class Extent(NamedTuple):
    """How much is measured.

    The ``finest`` level is for the sphere alone and, of so many ``revolved`` bodies, for every
    third and those beyond Re 40; correlations meet the last of the other ``levels`` on the
    ellipsoids of ``practice``.
    """

    levels: Sequence[Fidelity]
    finest: Sequence[Fidelity]
    sphere: Sequence[float]
    creeping: Sequence[Ratios]
    revolved: int
    elements: Elements
    practice: Sequence[Ratios]
    numbers: Sequence[float]


def whole() -> Extent:
    scenes = (Scene(dimension=3, fidelity=name) for name in ("draft", "standard", "fine"))
    *levels, finest = (scene.fidelity for scene in scenes)
    practice = [(0.5, 1.0), (1.0, 1.0), (2.0, 1.0), (4.0, 1.0), (2.0, 2.0)]
    creeping = [*practice, (2.0, 1.5), (1.0, 2.0), (0.7, 2.0), (4.0, 2.0)]
    numbers = (0.1, 1.0, 10.0, 100.0)
    return Extent(levels, [finest], list(SPHERE), creeping, 12, ELEMENTS, practice, numbers)


def small() -> Extent:
    sphere = [(1.0, 1.0)]
    return Extent([TINY], [], [1.0], sphere, 1, COARSE, sphere, [1.0])


def measure(tiny: bool, progress: Callable) -> Result:
    """Cd, error, work and time: of flows, of elements, of correlations."""
    extent = small() if tiny else whole()
    result: Result = {"rows": [], "missing": ""}
    parts = (_sphere, _ellipsoids, _practice, _sphere_by_elements, _revolved)
    for k, part in enumerate(parts):
        progress(k / len(parts))
        try:
            for field in part(extent):
                progress(k / len(parts), "{panel}: {row}, {column}".format(**field))
                result["rows"].append(field)
                if len(result["rows"]) % 10 == 0:
                    jax.clear_caches()  # Linux grants a process so many memory maps
        except InvalidInput as missing:
            result["missing"] = str(missing)
    return result


def _sphere(extent: Extent) -> Fields:
    for level in (*extent.levels, *extent.finest):
        for re in extent.sphere:
            place = _place("sphere", level.name, f"Re {re:g}")
            yield place | _by_flow({"aspect": 1.0}, re, level, SPHERE[re])


def _sphere_by_elements(extent: Extent) -> Fields:
    for re in extent.sphere:
        place = _place("sphere", "finite elements", f"Re {re:g}")
        yield place | _by_elements({"aspect": 1.0}, re, extent.elements, SPHERE[re])


def _ellipsoids(extent: Extent) -> Fields:
    """Against the exact drag."""
    for ratios in extent.creeping:
        place = f"ellipsoids, Re {CREEPING:g}", _name(ratios)
        exact = oberbeck(ellipsoid(*ratios), CREEPING)
        yield _place(*place, "exact Cd") | _found(exact)
        for level in extent.levels:
            cd = _solve(ellipsoid_body(ratios), CREEPING, level).drag
            yield _place(*place, level.name) | _found(cd, exact)


def _practice(extent: Extent) -> Fields:
    """What correlations have for the flow's drag."""
    for ratios in extent.practice:
        for re in extent.numbers:
            cd = _solve(ellipsoid_body(ratios), re, extent.levels[-1]).drag
            yield _place("Cd of the flow", _name(ratios), f"Re {re:g}") | _found(cd)
            for name, correlation in CORRELATIONS.items():
                place = _place(name, _name(ratios), f"Re {re:g}")
                yield place | _found(correlation(ellipsoid(*ratios), re), cd)


def _revolved(extent: Extent) -> Fields:
    """Held-out bodies against elements."""
    form = "{aspect:.2f}; {beta2:+.2f}, {beta3:+.2f}, {beta4:+.2f}; {re:.3g}"
    for k, (body, re) in enumerate(held_out(extent.revolved)):
        row, exact = form.format(re=re, **body), _by_elements(body, re, extent.elements)
        yield _place(HELD_OUT, row, "finite elements") | exact
        finest = extent.finest if k % 3 == 0 or re > THIN_LAYER_RE else ()
        for level in (*extent.levels, *finest):
            yield _place(HELD_OUT, row, level.name) | _by_flow(body, re, level, exact["cd"])


def held_out(count: int) -> list[tuple[dict[str, float], float]]:
    """Bodies of revolution, their aspects and Re spread evenly in the log, betas at random."""
    keys = jax.random.split(jax.random.key(SEED))
    bodies = np.array(REVOLVED.sample(keys[0], count))
    aspect = REVOLVED.names.index("aspect")
    bodies[:, aspect] = np.geomspace(*REVOLVED.bounds[aspect], count)
    numbers = jax.random.permutation(keys[1], np.geomspace(*NUMBERS, count))
    return [(REVOLVED.named(body), float(re)) for body, re in zip(bodies, numbers, strict=True)]


def ellipsoid_body(ratios: Ratios) -> dict[str, float]:
    """Of the family, by aspect and flatness."""
    aspect, flatness = ratios
    return {"aspect": aspect} | ({} if flatness == 1 else {"flatness": flatness})


def name_of(body: Mapping[str, float], form: str = "g") -> str:
    """Its parameters, written so."""
    return ", ".join(f"{name} {value:{form}}" for name, value in body.items())


def _name(ratios: Ratios) -> str:
    return "aspect {:g}, flatness {:g}".format(*ratios)


def _place(panel: str, row: str, column: str) -> dict[str, Any]:
    return {"panel": panel, "row": row, "column": column}


def _found(
    cd: float, exact: float | None = None, work: int | None = None, seconds: float | None = None
) -> dict[str, Any]:
    error = relative_error(cd, exact)
    return {"cd": cd, "error": error, "green_applications": work, "seconds": seconds}


def _by_elements(
    body: Mapping[str, float], re: float, elements: Elements, exact: float | None = None
) -> dict[str, Any]:
    found = solve_by_axisymmetric_elements(body, re, elements)
    return _found(found.cd, exact, seconds=found.seconds) | {"unknowns": found.unknowns}


def _by_flow(body: Mapping[str, float], re: float, level: Fidelity, exact: float) -> dict[str, Any]:
    """With its processor seconds after compilation."""
    _solve(body, re, level)
    start = time.process_time()
    found = _solve(body, re, level)
    return _found(found.drag, exact, found.green_applications, time.process_time() - start)


def _solve(body: Mapping[str, float], re: float, level: Fidelity) -> Solution:
    flow = Flow(Scene(dimension=3, fidelity=level))
    return flow.solve(family_shape(body, dimension=3), re, estimate=False)


def tables(result: Result) -> str:
    """Errors, with processor seconds; what the held-out bodies come to; what is missing."""
    rows = result["rows"]
    solved = [row for row in rows if row["panel"] == HELD_OUT and row["error"] is not None]
    levels = dict.fromkeys(row["column"] for row in solved)
    form = "{name} is {mean:.2%} off on average and {most:.2%} at most"
    lines = [_off(form, name, [r for r in solved if r["column"] == name]) for name in levels]
    form = "{name} is {mean:.0%} off on average and {most:.0%} at most."
    correlated = ((name, [r for r in rows if r["panel"] == name]) for name in CORRELATIONS)
    practice = " ".join(_off(form, *one) for one in correlated)
    told = f"Of bodies of revolution {', '.join(lines)}." if lines else result["missing"]
    return f"{map_tables(rows, _word)}\n\n{told}\n\n{practice}"


def _off(form: str, name: str, rows: list[Field]) -> str:
    """What errors come to, in words."""
    mean, most = mean_and_most(row["error"] for row in rows)
    return words(form, name=name, mean=mean, most=most)


def relative_error(cd: float | None, exact: float | None) -> float | None:
    """Where both are known."""
    return None if cd is None or exact is None else cd / exact - 1


def mean_and_most(errors: Iterable[float | None]) -> tuple[float | None, float | None]:
    """Of the sizes of those that are known."""
    known = [abs(error) for error in errors if error is not None]
    return (float(np.mean(known)), max(known)) if known else (None, None)


def _word(field: Field) -> str:
    """Error, or Cd where there is none; work and time where they were taken."""
    form = "{cd:.4g}" if field["error"] is None else "{error:+.2%}"
    if field["green_applications"]:
        form += ", {green_applications} G"
    if field["seconds"]:
        form += " in {seconds:.1f} s"
    return words(form, **field)


STUDY = Study("space", measure, tables)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
