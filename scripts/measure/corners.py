"""Corners of the family in space, where a search found the largest errors, and wide bodies.

python scripts/measure/corners.py

Are promises kept, and where they are not, does the status say so? The elements need NGSolve:
pip install -e '.[bench]'.
"""

import sys
from collections.abc import Callable, Mapping

from axisymmetric import cd_by_axisymmetric_elements
from flattened import FINER, solve_by_elements_in_space
from space import COARSE, name_of, relative_error
from study import TINY, Result, Study, has_ngsolve, run_study, table_of_rows

from surrogate import Flow, Scene, family_shape
from surrogate.scene.fidelity import SPACE_FIDELITIES

STUBBY = {"aspect": 0.5, "beta2": -0.2, "beta3": 0.15, "beta4": -0.1}
BLUNT = {"aspect": 0.6, "beta2": -0.25, "beta3": 0.15, "beta4": -0.08}
POINTED = {"aspect": 4.0, "beta2": -0.3}
FLATTENED = {"aspect": 2.5, "flatness": 2.0, "beta2": 0.2, "beta3": 0.1}
BROAD = {"aspect": 0.7, "flatness": 2.0, "beta2": -0.1}
FULL = {"aspect": 0.5, "beta2": 0.25, "beta3": 0.15, "beta4": 0.08}
LEAN = {"aspect": 4.0, "beta2": 0.2, "beta3": -0.1, "beta4": 0.05}
CORNERS = (
    *((STUBBY, 60.0), (STUBBY, 100.0), (BLUNT, 100.0), (FULL, 20.0), (LEAN, 5.0)),
    *((FLATTENED, 40.0), (BROAD, 10.0), (POINTED, 1.0), (POINTED, 10.0)),
)
HEADS = "body | Re | fidelity | off elements by | promised | estimated error | status"
FORMS = "{body} | {re:g} | {fidelity} | {error:+.2%} | {promise:.2%} | {estimate:.2%} | {status}"


def measure(tiny: bool, progress: Callable) -> Result:
    """Bodies on draft and standard, against elements."""
    levels = [TINY] if tiny else [SPACE_FIDELITIES[name] for name in ("draft", "standard")]
    chosen = CORNERS[:1] if tiny else CORNERS
    rows = []
    for k, (body, re) in enumerate(chosen):
        name = name_of(body)
        progress(k / len(chosen), f"{name}, Re {re:g}")
        exact = _by_elements(body, re, tiny)
        for level in levels:
            flow = Flow(Scene(dimension=3, fidelity=level))
            found = flow.solve(family_shape(body, dimension=3), re)
            row = {"body": name, "re": re, "fidelity": level.name, "promise": level.promise}
            row |= {"estimate": found.estimated_error, "status": found.status}
            rows.append(row | {"error": relative_error(found.drag, exact)})
    return {"rows": rows}


def _by_elements(body: Mapping[str, float], re: float, tiny: bool) -> float | None:
    """Cd, of bodies of revolution by elements of their half plane; None without NGSolve."""
    if "flatness" not in body:
        return cd_by_axisymmetric_elements(body, re, *((COARSE,) if tiny else ()))
    return solve_by_elements_in_space(body, re, FINER).cd if has_ngsolve() else None


STUDY = Study("corners", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
