"""Error of the 2-D flow: against references, over its range, over cells, over the domain."""

import functools
from collections.abc import Iterator, Mapping

from study import TINY, Row, Run, Study, Table, maps, place, words
from tools import solved

from surrogate import FIDELITIES, Fidelity

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


def cases(run: Run) -> Iterator[Row]:
    """Every fidelity against elements and over its range; then cells and domain alone."""
    if run.tiny:
        yield _case("accuracy", "tiny", 1.0, TINY, REFERENCES["unbounded"][1.0])
        yield _case("order", "tiny", 1.0, TINY, TINY)
        return
    for name, level in FIDELITIES.items():
        for stream, drags in REFERENCES.items():
            for re, drag in drags.items():
                yield _case("accuracy", f"{name}, {stream}", re, level, drag) | {"stream": stream}
    for name, level in FIDELITIES.items():
        for aspect in (0.5, 1.0, 2.0, 5.0):
            for re in (0.5, 5.0, 45.0):
                row = f"{name}, aspect {aspect:g}"
                yield _case("range", row, re, level, FINEST, {"aspect": aspect})
    for name, body in (("cylinder", CYLINDER), ("slender body", SLENDER)):
        for cells in (8, 12, 16, 24):
            for re in (1.0, 10.0, 40.0):
                grids = (Fidelity("order", n, 3, 5, 5, wake=0.0) for n in (cells, 40))
                yield _case("order", f"{name}, n = {cells}", re, *grids, body)
    for domain in ((3, 5, 6), (4, 8, 8), (6, 12, 8), (8, 16, 12)):
        for re in (1.0, 10.0, 40.0):
            level = Fidelity("window", 10, *domain, wake=0.0)
            yield _case("window", "{} + {} by {}".format(*domain), re, level, LARGEST)


def _case(
    panel: str,
    row: str,
    reynolds: float,
    fidelity: Fidelity,
    truth: float | Fidelity,
    body: Mapping[str, float] = CYLINDER,
) -> Row:
    """A flow with the drag that it should have, or with the fidelity that tells it."""
    flow = {"reynolds": reynolds, "fidelity": fidelity, "body": body}
    return place(panel, row, f"Re {reynolds:g}") | flow | {"truth": truth}


def measure(run, body, reynolds, fidelity, truth, stream="unbounded", **_) -> Row:
    """Drag, error, work, and seconds of a second solve, without compilation."""
    if isinstance(truth, Fidelity):
        truth = _drag_once(tuple(body.items()), reynolds, truth)
    solved(body, reynolds, fidelity, stream=stream)
    found = solved(body, reynolds, fidelity, stream=stream)
    drag = {"cd": found.drag, "reference": truth, "error": found.drag / truth - 1}
    return drag | {"green_applications": found.green_applications, "seconds": found.seconds}


@functools.cache
def _drag_once(body: tuple, reynolds: float, fidelity: Fidelity) -> float:
    return solved(dict(body), reynolds, fidelity).drag


CELL = "{error:+.2%} in {seconds:.3f} s"
STUDY = Study([Table(cases, measure, maps(lambda row: words(CELL, **row)), tiny="all")])
