"""Error of the extrapolated drag in 3-D beside that of the drag itself, of fine flows."""

from collections.abc import Iterator

from correlations import ellipsoid, oberbeck
from elements import AXISYMMETRIC, TINY_ELEMENTS, reference_cd
from studies.flow_3d import CREEPING, ELLIPSOIDS, SPHERE, ellipsoid_body, held_out
from study import Result, Row, Run, Study, Table, columns, words
from tools import mean_and_most, name_of, relative_error, solved


def cases(run: Run) -> Iterator[Row]:
    """The bodies that ``flow_3d`` measures, with their exact Cd where it is known."""
    for re, exact in list(SPHERE.items())[run.pick(slice(1, 2), slice(None))]:
        yield _case({"aspect": 1.0}, re, exact)
    for ratios in ELLIPSOIDS:
        yield _case(ellipsoid_body(*ratios), CREEPING, oberbeck(ellipsoid(*ratios), CREEPING))
    for body, re in held_out():
        yield _case(body, re, None)


def _case(body, re, exact) -> Row:
    return {"body": name_of(body, ".2f"), "re": re, "parameters": body, "exact": exact}


def measure(run, parameters, re, exact, **_) -> Row:
    """Errors of both drags, against the exact one or elements."""
    found = solved(parameters, re, run.fidelity("fine", 3), 3, estimate=True)
    elements = run.pick(TINY_ELEMENTS, None)
    exact = exact or reference_cd(AXISYMMETRIC, parameters, re, elements)
    return {
        "error": relative_error(found.drag, exact),
        "extrapolated": relative_error(found.extrapolated_drag, exact),
        "estimate": found.estimated_error,
        "status": found.status,
    }


def text(result: Result) -> str:
    """Mean and largest errors."""
    form = (
        "Error of the drag: {drag[0]:.2%} on average, {drag[1]:.2%} at most; of the extrapolated "
        "drag: {limit[0]:.2%} and {limit[1]:.2%}."
    )
    drag, limit = (
        mean_and_most(row[key] for row in result["rows"]) for key in ("error", "extrapolated")
    )
    return words(form, drag=drag, limit=limit)


COLUMNS = "body {body} | Re {re:.3g} | error of the drag {error:+.2%}"
COLUMNS += " | of the extrapolated drag {extrapolated:+.2%} | estimated error {estimate:.2%}"
STUDY = Study([Table(cases, measure, columns(f"{COLUMNS} | status {{status}}"))], text)
