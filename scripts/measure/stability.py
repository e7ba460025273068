"""Where each method trains, stalls or blows up, by step size, batch, Re, precision, truncation.

python scripts/measure/stability.py
"""

import dataclasses
import math
import sys
from collections.abc import Callable, Iterator
from typing import Any

import jax.numpy as jnp
import numpy as np
from maps import draw_maps, map_tables
from study import Result, Study, run_study, words
from training import attempt, shrunk

from surrogate import Scene
from surrogate.training.loop import drag_errors, make_setup
from surrogate.training.methods.method import Method
from surrogate.training.plan import MAKERS, Plan, make_plan

USUAL = {  # iterations of a short training, batch, step size
    "dp": (40, 4, {"learning_rate": 1e-2}),
    "sip": (16, 8, {"learning_rate": 3e-3}),
    "hig": (12, 16, {"eta": 1.0}),
    "supervised": (16, 8, {"learning_rate": 3e-3}),
}
SHARES = {"trained": 0.1, "slow": 0.9, "stalled": 1.1, "diverged": math.inf}  # of the error before
COLOURS = {"trained": "#4c9f70", "slow": "#b8d8a0", "stalled": "#e8c468"}
COLOURS |= {"diverged": "#e08e58", "blew up": "#c8553d"}


def variants() -> Iterator[tuple[str, str, Plan, Method]]:
    """All fields of the map: panel, value, and a training with that value."""
    for tau in (1e-12, 1e-8, 1e-5, 1e-3, 1e-2, 1e-1):
        yield "truncation tau", f"{tau:g}", *_made("hig", tau=tau)
    for kappa in (-1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 1.0):
        yield "exponent kappa", f"{kappa:g}", *_made("hig", kappa=kappa)
    for name, (_, _, step) in USUAL.items():
        for factor in (0.01, 0.1, 1.0, 10.0, 100.0):
            changed = {key: factor * size for key, size in step.items()}
            yield "step size, times", f"{factor:g}", *_made(name, **changed)
        for batch in (1, 4, 16, 64, 256):
            large = {"vectors": 128} if name == "hig" and batch > 64 else {}
            yield "batch (of 256)", f"{batch}", *_made(name, samples=256, batch=batch, **large)
        for low, high in ((10.0, 20.0), (1.0, 40.0), (0.1, 45.0)):
            yield "Reynolds range", f"{low:g} to {high:g}", *_made(name, reynolds=(low, high))
        plan, method = _made(name)
        yield "weights", "float32", plan, rounded(method)
        yield "weights", "float64", plan, method


def _made(name: str, samples=64, reynolds=(1.0, 40.0), **settings: Any) -> tuple[Plan, Method]:
    """A short training; small batches get more steps, up to three times as many."""
    iterations, usual, _ = USUAL[name]
    settings = {"batch": usual} | settings
    more = np.clip(usual / settings["batch"], 1.0, 3.0)
    plan = make_plan(Scene(reynolds=reynolds, fidelity="draft"), name, "quick", samples)
    short = {"held_out": 16, "iterations": round(iterations * more), "report_every": 1}
    return dataclasses.replace(plan, **short), MAKERS[name](**settings)


def rounded(method: Method) -> Method:
    """The method with weights that are rounded to single precision after every step."""

    class Rounded(type(method)):
        def update(self, *arguments):
            network, optimiser, loss = super().update(*arguments)
            weights = network.weights.astype(jnp.float32).astype(float)
            return network.with_weights(weights), optimiser, loss

    return Rounded(**vars(method))


def measure(tiny: bool, progress: Callable) -> Result:
    """Train every variant from the same weights for a small budget."""
    chosen, benches, fields = list(variants())[-1 if tiny else None :], {}, []
    for k, (panel, value, plan, method) in enumerate(chosen):
        progress(k / len(chosen), f"{panel} {value}, {plan.method}")
        plan = shrunk(plan) if tiny else plan
        ground = plan.scene, plan.samples
        bench = benches[ground] = benches.get(ground) or make_setup(plan)
        before = float(drag_errors(bench.network, bench.held_out, bench.labels.drag).mean())
        found = attempt(plan, bench, method) | {"before": before}
        if found["outcome"] == "trained":
            share = found["mean"] / before
            found["outcome"] = next(name for name, most in SHARES.items() if share < most)
        else:
            found["outcome"] = "blew up"
        fields.append({"panel": panel, "row": plan.method, "column": value} | found)
    return {"fields": fields}


def tables(result: Result) -> str:
    return map_tables(result["fields"], lambda field: words("{mean:.2%}, {outcome}", **field))


def draw(result, path):
    draw_maps(
        result["fields"], lambda field: words("{mean:.1%}", **field), COLOURS, path, abreast=3
    )


STUDY = Study("stability", measure, tables, draw)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
