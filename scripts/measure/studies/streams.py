"""A stream of queries answered by several processes that share one file of solved flows."""

import json
import multiprocessing
import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from study import TINY, Row, Run, Study, Table, columns

from shapeopt import Designer, Problem
from shapeopt.payoff.queries import query_stream
from surrogate import Flow, Scene

QUERIES = 12  # whose flows, 64 at most, one size of compiled models holds
WAYS = {  # processes, each on a core of its own; whether they share a memory file
    "two processes, one memory": (2, True),
    "one process": (1, True),
    "two processes, each its own memory": (2, False),
}


def measure(run: Run, way: str) -> Row:
    """The same designs by growing kriging from nothing; flows that are missing in the file."""
    scene, (count, shared) = Scene(fidelity=run.pick(TINY, "standard")), WAYS[way]
    queries = query_stream(scene, 0, run.pick(2, QUERIES))
    with tempfile.TemporaryDirectory() as scratch:
        context = multiprocessing.get_context("spawn")
        with context.Manager() as manager, context.Pool(count) as pool:
            together = manager.Barrier(count)
            shares = [
                (queries, f"{scratch}/{0 if shared else k}.json", k, count, together)
                for k in range(count)
            ]
            found = pool.starmap(_answer, shares, chunksize=1)
        files = [json.loads(file.read_text()) for file in Path(scratch).glob("*.json")]
    flows = sum(flows for flows, _ in found)
    lost = flows - sum(len(file["flows"]) for file in files)
    seconds = max(seconds for _, seconds in found)
    return {"queries": len(queries), "flows": flows, "lost": lost, "seconds": seconds}


def _answer(
    queries: Sequence[Problem], file: str, place: int, processes: int, together: Any
) -> tuple[int, float]:
    """Flows of one process's share of the queries, and seconds.

    Every process has solved all queries before, so that little is left to compile.
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


COLUMNS = "strategy {way} | queries {queries} | flows {flows} | flows lost {lost}"
CASES = [{"way": way} for way in WAYS]
STUDY = Study([Table(lambda run: CASES, measure, columns(f"{COLUMNS} | time {{seconds:.1f}} s"))])
