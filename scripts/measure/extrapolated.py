"""What two grids tend to: the extrapolated drag in space beside the drag itself, of fine flows.

python scripts/measure/extrapolated.py

The elements need NGSolve: pip install -e '.[bench]'.
"""

import sys
from collections.abc import Callable

import numpy as np
from axisymmetric import ELEMENTS, solve_by_axisymmetric_elements
from elements import Elements
from space import SPHERE, held_out
from study import TINY, Result, Study, run_study, table_of_rows, words

from surrogate import Flow, InvalidInput, Scene, family_shape
from surrogate.flow.grid.immersed import THIN

BODIES = 12  # held out
COARSE = Elements(order=2, box=10.0, wall=0.2, near=0.5)
HEADS = "body | Re | drag, off elements by | extrapolated | estimated error"
FORMS = "{body} | {re:.3g} | {error:+.2%} | {extrapolated:+.2%} | {estimate:.2%}"


def measure(tiny: bool, progress: Callable) -> Result:
    """Of the sphere, and of held-out bodies: every third, and those beyond Re 40."""
    level, elements = (TINY, COARSE) if tiny else ("fine", ELEMENTS)
    flow = Flow(Scene(dimension=3, fidelity=level))
    cases = [({"aspect": 1.0}, re) for re in ([1.0] if tiny else SPHERE)]
    held = [] if tiny else enumerate(held_out(BODIES))
    cases += [(body, re) for k, (body, re) in held if k % 3 == 0 or re > THIN]
    rows, missing = [], ""
    for k, (body, re) in enumerate(cases):
        name = ", ".join(f"{key} {value:.2f}" for key, value in body.items())
        progress(k / len(cases), f"{name}, Re {re:.3g}")
        found = flow.solve(family_shape(body, dimension=3), re)
        try:
            exact = solve_by_axisymmetric_elements(body, re, elements).cd
        except InvalidInput as reason:
            exact, missing = None, str(reason)
        rows.append(
            {
                "body": name,
                "re": re,
                "error": _off(found.drag, exact),
                "extrapolated": _off(found.extrapolated_drag, exact),
                "estimate": found.estimated_error,
            }
        )
    return {"rows": rows, "missing": missing}


def _off(drag: float | None, exact: float | None) -> float | None:
    return None if drag is None or exact is None else drag / exact - 1


def tables(result: Result) -> str:
    """Both errors, and what they come to."""
    form = (
        "The drag is {mean:.2%} off on average and {most:.2%} at most, "
        "the extrapolated one {tends:.2%} and {furthest:.2%}."
    )
    mean, most = _summary(result["rows"], "error")
    tends, furthest = _summary(result["rows"], "extrapolated")
    told = words(form, mean=mean, most=most, tends=tends, furthest=furthest)
    return f"{table_of_rows(HEADS, FORMS)(result)}\n\n{result.get('missing') or told}"


def _summary(rows, name):
    errors = [abs(row[name]) for row in rows if row[name] is not None]
    return (np.mean(errors), max(errors)) if errors else (None, None)


STUDY = Study("extrapolated", measure, tables)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
