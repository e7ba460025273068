"""Where each method trains, stalls or diverges, by step size, batch, Re, precision, truncation."""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import jax.numpy as jnp
import numpy as np
from figures import draw_maps
from studies.training import attempt, setup_of, shrunk
from study import Row, Run, Study, Table, maps, place, words

from surrogate import Scene
from surrogate.training.loop import drag_errors
from surrogate.training.methods.method import Method
from surrogate.training.plan import MAKERS, Plan, make_plan

USUAL = {  # iterations of a short training, batch, step size
    "dp": (40, 4, {"learning_rate": 1e-2}),
    "sip": (16, 8, {"learning_rate": 3e-3}),
    "hig": (12, 16, {"eta": 1.0}),
    "supervised": (16, 8, {"learning_rate": 3e-3}),
}
SHARES = {"trained": 0.1, "slow": 0.9, "stalled": 1.1, "diverged": math.inf}  # of the first error
COLOURS = {"trained": "#4c9f70", "slow": "#b8d8a0", "stalled": "#e8c468"}
COLOURS |= {"diverged": "#e08e58", "blew up": "#c8553d"}


def cases(run: Run) -> Iterator[Row]:
    """One setting at a time; rows are methods, columns values."""
    for tau in (1e-12, 1e-8, 1e-5, 1e-3, 1e-2, 1e-1):
        yield _case("truncation tau", f"{tau:g}", "hig", tau=tau)
    for kappa in (-1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 1.0):
        yield _case("exponent kappa", f"{kappa:g}", "hig", kappa=kappa)
    for name, (_, _, step) in USUAL.items():
        for factor in (0.01, 0.1, 1.0, 10.0, 100.0):
            changed = {key: factor * size for key, size in step.items()}
            yield _case("step size, times", f"{factor:g}", name, **changed)
        for batch in (1, 4, 16, 64, 256):
            large = {"vectors": 128} if name == "hig" and batch > 64 else {}
            yield _case("batch (of 256)", f"{batch}", name, samples=256, batch=batch, **large)
        for low, high in ((10.0, 20.0), (1.0, 40.0), (0.1, 45.0)):
            yield _case("Reynolds range", f"{low:g} to {high:g}", name, reynolds=(low, high))
        for precision in ("float32", "float64"):
            yield _case("weights", precision, name)


def _case(panel: str, value: str, name: str, samples=64, reynolds=(1.0, 40.0), **changes) -> Row:
    """A short training; small batches get more steps, up to three times as many."""
    iterations, usual, _ = USUAL[name]
    changes = {"batch": usual} | changes
    more = np.clip(usual / changes["batch"], 1.0, 3.0)
    plan = make_plan(Scene(reynolds=reynolds, fidelity="draft"), name, "quick", samples)
    short = {"held_out": 16, "iterations": round(iterations * more), "report_every": 1}
    plan = dataclasses.replace(plan, **short)
    return place(panel, name, value) | {"plan": plan, "changes": changes}


def measure(run: Run, row: str, column: str, plan: Plan, changes: Row, **_: Any) -> Row:
    """The outcome of the training from the same weights."""
    plan, method = run.pick(shrunk(plan), plan), MAKERS[row](**changes)
    setup = setup_of(plan)
    before = float(drag_errors(setup.network, setup.held_out, setup.labels.drag).mean())
    found = attempt(plan, rounded(method) if column == "float32" else method)
    outcome = "blew up"
    if found["outcome"] == "trained":
        share = found["mean"] / before
        outcome = next(name for name, most in SHARES.items() if share < most)
    return found | {"before": before, "outcome": outcome}


def rounded(method: Method) -> Method:
    """The method with weights that are rounded to single precision after every step."""

    def learn(*arguments):
        network, memory, loss = method.learn(*arguments)
        weights = network.weights.astype(jnp.float32).astype(float)
        return network.with_weights(weights), memory, loss

    return method._replace(learn=learn)


def draw(result, path):
    draw_maps(result["fields"], lambda row: words("{mean:.1%}", **row), COLOURS, path, abreast=3)


CELL = maps(lambda row: words("{mean:.2%}, {outcome}", **row))
STUDY = Study([Table(cases, measure, CELL, "fields", "last")], draw=draw)
