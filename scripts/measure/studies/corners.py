"""Corners of the 3-D family with the largest errors, and wide bodies: does the status say so?"""

from collections.abc import Iterator

from elements import AXISYMMETRIC, FLATTENED, TINY_ELEMENTS, reference_cd
from meshes import Elements
from study import Row, Run, Study, Table, columns
from tools import name_of, solved

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


def cases(run: Run) -> Iterator[Row]:
    """Every body on draft and standard."""
    for body, re in CORNERS:
        for name in ("draft", "standard"):
            case = {"body": name_of(body), "re": re, "fidelity": run.fidelity(name, 3)}
            yield case | {"parameters": body}


def measure(run, parameters, re, fidelity, **_) -> Row:
    """Error against elements beside the estimated error."""
    found = solved(parameters, re, fidelity, 3, estimate=True)
    geometry, elements = AXISYMMETRIC, run.pick(TINY_ELEMENTS, None)
    if "flatness" in parameters:
        geometry, elements = FLATTENED, FINER
    error = found.drag / reference_cd(geometry, parameters, re, elements) - 1
    row = {"promise": fidelity.promise, "estimate": found.estimated_error, "status": found.status}
    return row | {"error": error}


COLUMNS = "body {body} | Re {re:g} | fidelity {fidelity} | error against elements {error:+.2%}"
COLUMNS += " | error tolerance {promise:.2%} | estimated error {estimate:.2%} | status {status}"
STUDY = Study([Table(cases, measure, columns(COLUMNS))])
