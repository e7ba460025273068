"""A stream of queries answered by several processes that share one memory of flows.

python scripts/measure/streams.py
"""

import json
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from study import TINY, Result, Study, run_study, table_of_rows

from shapeopt import Designer, Problem
from shapeopt.payoff.queries import query_stream
from surrogate import Flow, Scene

QUERIES = 12  # whose flows, 64 at most, one size of compiled models holds


class Way(NamedTuple):
    """So many processes, each on a core of its own, with one memory or each with its own."""

    name: str
    processes: int
    shared: bool = True


WAYS = (
    Way("one process", 1),
    Way("two processes, one memory", 2),
    Way("two processes, each its own memory", 2, shared=False),
)


def measure(tiny: bool, progress: Callable) -> Result:
    """The same designs by growing kriging every way, from nothing; flows that a file has lost."""
    scene, rows = Scene(fidelity=TINY if tiny else "standard"), list[dict[str, Any]]()
    queries = query_stream(scene, 0, 2 if tiny else QUERIES)
    for k, way in enumerate(WAYS[1:2] if tiny else WAYS):
        progress(k / len(WAYS), way.name)
        with tempfile.TemporaryDirectory() as scratch:
            rows.append(
                {"way": way.name, "queries": len(queries)} | _answered(way, queries, scratch)
            )
    return {"rows": rows}


def _answered(way: Way, queries: Sequence[Problem], scratch: str) -> dict[str, Any]:
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager, context.Pool(way.processes) as pool:
        together = manager.Barrier(way.processes)
        shares = [
            (queries, f"{scratch}/{0 if way.shared else k}.json", k, way.processes, together)
            for k in range(way.processes)
        ]
        found = pool.starmap(_answer, shares, chunksize=1)
    files = Path(scratch).glob("*.json")
    kept = sum(len(json.loads(file.read_text())["flows"]) for file in files)
    asked = sum(flows for flows, _ in found)
    seconds = max(seconds for _, seconds in found)
    return {"flows": asked, "lost": asked - kept, "seconds": seconds}


def _answer(
    queries: Sequence[Problem], file: str, place: int, processes: int, together: Any
) -> tuple[int, float]:
    """Flows of a share of the queries, and seconds.

    All of them were answered once before, so nothing, or little, is left to compile.
    """
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[place % len(cores)]})
    flow = Flow(queries[0].scene)
    rehearsal = Designer(flow)
    for query in queries:
        rehearsal.design(query)
    together.wait()
    begin, designer = time.perf_counter(), Designer(flow, memory=file)
    flows = sum(designer.design(query).flows for query in queries[place::processes])
    return flows, time.perf_counter() - begin


FORMS = "{way} | {queries} | {flows} | {lost} | {seconds:.1f} s"
STUDY = Study("streams", measure, table_of_rows("way | queries | flows asked | lost | time", FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
