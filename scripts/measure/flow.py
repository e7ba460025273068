"""How right the flow is: against references, over its range, its order in h, its window.

python scripts/measure/flow.py
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import jax
from maps import map_tables
from study import TINY, Result, Study, run_study, words

from surrogate import FIDELITIES, Fidelity, Flow, Scene, family_shape

# cylinder, body-fitted finite elements with the far field removed, uncertainty about 1e-4
REFERENCES = {
    "unbounded": {1.0: 10.335, 5.0: 3.930, 10.0: 2.754, 20.0: 1.999, 40.0: 1.497},
    "tunnel:16": {1.0: 13.743, 10.0: 3.072, 40.0: 1.625},
    "tunnel:8": {1.0: 18.412, 10.0: 3.548, 40.0: 1.841},
}
CYLINDER = {"aspect": 1.0}
SLENDER = {"aspect": 4.0, "beta2": 0.2, "beta3": 0.1, "beta4": 0.05}
FINEST = Fidelity("finest", 40, 10, 24, 16, wake=0.3)
LARGEST = Fidelity("largest", 10, 10, 24, 16, wake=0.0)


class Case(NamedTuple):
    """A flow, and the drag it should have or the fidelity that tells it."""

    panel: str
    row: str
    reynolds: float
    fidelity: Fidelity
    reference: float | Fidelity
    body: Mapping[str, float] = CYLINDER
    stream: str = "unbounded"


def cases() -> Iterator[Case]:
    """Every fidelity against elements and over its range; then cells and window alone."""
    for name, level in FIDELITIES.items():
        for stream, drags in REFERENCES.items():
            for re, drag in drags.items():
                yield Case("accuracy", f"{name}, {stream}", re, level, drag, stream=stream)
    for name, level in FIDELITIES.items():
        for aspect in (0.5, 1.0, 2.0, 5.0):
            for re in (0.5, 5.0, 45.0):
                row = f"{name}, aspect {aspect:g}"
                yield Case("range", row, re, level, FINEST, {"aspect": aspect})
    for name, body in (("cylinder", CYLINDER), ("slender body", SLENDER)):
        for cells in (8, 12, 16, 24):
            for re in (1.0, 10.0, 40.0):
                grids = (Fidelity("order", n, 3, 5, 5, wake=0.0) for n in (cells, 40))
                yield Case("order", f"{name}, n = {cells}", re, *grids, body)
    for window in ((3, 5, 6), (4, 8, 8), (6, 12, 8), (8, 16, 12)):
        for re in (1.0, 10.0, 40.0):
            level = Fidelity("window", 10, *window, wake=0.0)
            yield Case("window", "{} + {} by {}".format(*window), re, level, LARGEST)


def measure(tiny: bool, progress: Callable) -> Result:
    """Drag, error, work and time of every case."""
    chosen, truths, rows = list(cases()), {}, []
    if tiny:
        truth = REFERENCES["unbounded"][1.0]
        chosen = [
            Case("accuracy", "tiny", 1.0, TINY, truth),
            Case("order", "tiny", 1.0, TINY, TINY),
        ]
    for k, case in enumerate(chosen):
        progress(k / len(chosen), f"{case.panel}: {case.row}, Re {case.reynolds:g}")
        truth = case.reference
        if isinstance(truth, Fidelity):
            key = (*case.body.values(), case.reynolds, truth)
            truths[key] = truths.get(key) or _solved(case._replace(fidelity=truth)).drag
            truth = truths[key]
        _solved(case)  # compiles
        found = _solved(case)
        place = {"panel": case.panel, "row": case.row, "column": f"Re {case.reynolds:g}"}
        drag = {"cd": found.drag, "reference": truth, "error": found.drag / truth - 1}
        cost = {"green_applications": found.green_applications, "seconds": found.seconds}
        rows.append(place | drag | cost)
        if k % 10 == 9:
            jax.clear_caches()  # Linux grants a process so many memory maps, and these add up
    return {"rows": rows}


def _solved(case: Case):
    flow = Flow(Scene(case.stream, fidelity=case.fidelity))
    shape = family_shape(case.body)
    return flow.solve(shape, case.reynolds, estimate=False, allow_unsteady=True)


def tables(result: Result) -> str:
    """Errors, and the time of a solve after compilation."""
    form = "{error:+.2%} in {seconds:.3f} s"
    return map_tables(result["rows"], lambda row: words(form, **row))


STUDY = Study("flow", measure, tables)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
