"""Thousands of bodies on one machine's devices; queries answered by several processes."""

import dataclasses
import json
import multiprocessing
import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
from studies.dimension import family_of
from study import TINY, Row, Run, Study, Table, cases, columns

from shapeopt import Designer, Problem
from shapeopt.payoff.queries import query_stream
from surrogate import Flow, Scene
from surrogate.devices import choose_devices
from surrogate.training.loop import run_training
from surrogate.training.plan import make_plan
from surrogate.training.setup import make_setup

PARAMETERS, STEPS = 9, 12
QUERIES = 12  # whose flows, 64 at most, one size of compiled models holds
STRATEGIES = {  # processes, each on a core of its own; whether they share a memory file
    "two processes, one memory": (2, True),
    "one process": (1, True),
    "two processes, each its own memory": (2, False),
}


def sizes(run: Run) -> list[Row]:
    """Return the cases, numbers of bodies; JAX learns its devices before it first uses them."""
    if (devices := run.options["devices"]) > 1:
        jax.config.update("jax_num_cpu_devices", devices)
    return cases(bodies=(256, 1024, 4096))


def large_training(run: Run, bodies: int) -> Row:
    """Train by HIG on many bodies in few steps, and return its times, work and errors."""
    scene = Scene(family=family_of(PARAMETERS), fidelity=run.pick(TINY, "draft"))
    count, steps = run.pick((8, 2), (bodies, STEPS))
    plan = make_plan(scene, "hig", "full", count)
    short = {"held_out": run.pick(4, 128), "iterations": steps, "report_every": 1}
    plan, begin = dataclasses.replace(plan, **short), time.perf_counter()
    setup = make_setup(plan, choose_devices(run.options["devices"]))
    trained = run_training(plan, setup, method=dataclasses.replace(plan.make_method(), batch=count))
    first, last = trained.history[0], trained.history[-1]
    return {
        "flows_s": setup.setup_s + first.seconds,
        "step_s": (last.seconds - first.seconds) / (len(trained.history) - 1),
        "green_applications": last.green_applications,
        "waiting": trained.idle_work / last.green_applications,
        "error_mean": last.error_mean,
        "error_max": last.error_max,
        "seconds": time.perf_counter() - begin,
    }


def stream(run: Run, strategy: str) -> Row:
    """Solve the same designs by kriging with memory from nothing, and count flows that were lost.

    A flow is lost if it is missing in the file.
    """
    scene, (count, shared) = Scene(fidelity=run.pick(TINY, "standard")), STRATEGIES[strategy]
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


LARGE = columns(
    "bodies {bodies} | flows and slopes {flows_s:.0f} s | idle work {waiting:.1%}"
    " | step of the network {step_s:.2f} s | mean error {error_mean:.3%}"
    " | largest {error_max:.2%} | total {seconds:.0f} s"
)
TEXT = (
    "Bodies of {parameters} parameters on the draft grid, spread over {devices} devices; HIG of "
    f"{STEPS} steps, so errors are not what a full training reaches. Flows are solved in the first "
    "step; the total includes compilation and held-out flows."
)
STREAM = columns(
    "strategy {strategy} | queries {queries} | flows {flows} | flows lost {lost}"
    " | time {seconds:.1f} s"
)
STUDIES = {
    "shards": Study(
        [Table(sizes, large_training, LARGE)],
        TEXT,
        lambda run, _: {"parameters": PARAMETERS, "devices": run.options["devices"]},
        options={"--devices": {"type": int, "default": 1, "help": "CPU devices of the bodies (1)"}},
    ),
    "streams": Study([Table(cases(strategy=STRATEGIES), stream, STREAM)]),
}
