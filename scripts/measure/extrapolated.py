"""What two grids tend to: the extrapolated drag in space beside the drag itself, of fine flows.

python scripts/measure/extrapolated.py

The elements need NGSolve: pip install -e '.[bench]'.
"""

import sys
from collections.abc import Callable, Iterator
from typing import NamedTuple

import jax
from axisymmetric import ELEMENTS, cd_by_axisymmetric_elements
from correlations import ellipsoid, oberbeck
from space import (
    COARSE,
    CREEPING,
    SPHERE,
    ellipsoid_body,
    held_out,
    mean_and_most,
    name_of,
    relative_error,
    whole,
)
from study import TINY, Result, Study, run_study, table_of_rows, words

from surrogate import Flow, Scene, family_shape

HEADS = "body | Re | drag, off by | extrapolated | estimated error | status"
FORMS = "{body} | {re:.3g} | {error:+.2%} | {extrapolated:+.2%} | {estimate:.2%} | {status}"


class Case(NamedTuple):
    """A body, its Re, and the exact Cd where it is known."""

    body: dict[str, float]
    reynolds: float
    exact: float | None = None


def measure(tiny: bool, progress: Callable) -> Result:
    """The sphere and ellipsoids against exact drags, held-out bodies against elements."""
    level, elements = (TINY, COARSE) if tiny else ("fine", ELEMENTS)
    flow, chosen = Flow(Scene(dimension=3, fidelity=level)), list(cases())[: 1 if tiny else None]
    rows = []
    for k, (body, re, exact) in enumerate(chosen):
        name = name_of(body, ".2f")
        progress(k / len(chosen), f"{name}, Re {re:.3g}")
        found = flow.solve(family_shape(body, dimension=3), re)
        exact = exact or cd_by_axisymmetric_elements(body, re, elements)
        errors = {
            "error": relative_error(found.drag, exact),
            "extrapolated": relative_error(found.extrapolated_drag, exact),
        }
        estimate = {"estimate": found.estimated_error, "status": found.status}
        rows.append({"body": name, "re": re} | errors | estimate)
        if k % 7 == 6:
            jax.clear_caches()  # Linux grants a process so many memory maps, and these add up
    return {"rows": rows}


def cases() -> Iterator[Case]:
    """All bodies that other levels are measured on."""
    extent = whole()
    for re in extent.sphere:
        yield Case({"aspect": 1.0}, re, SPHERE[re])
    for ratios in extent.creeping:
        exact = oberbeck(ellipsoid(*ratios), CREEPING)
        yield Case(ellipsoid_body(ratios), CREEPING, exact)
    for body, re in held_out(extent.revolved):
        yield Case(body, re)


def tables(result: Result) -> str:
    """Both errors, and what they come to."""
    form = (
        "The drag is {mean:.2%} off on average and {most:.2%} at most, "
        "the extrapolated one {tends:.2%} and {furthest:.2%}."
    )
    mean, most = mean_and_most(row["error"] for row in result["rows"])
    tends, furthest = mean_and_most(row["extrapolated"] for row in result["rows"])
    told = words(form, mean=mean, most=most, tends=tends, furthest=furthest)
    return f"{table_of_rows(HEADS, FORMS)(result)}\n\n{told}"


STUDY = Study("extrapolated", measure, tables)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
