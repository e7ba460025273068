"""A training set of thousands of bodies in eight modes, spread over the devices of this machine.

python scripts/measure/shards.py --devices 2
"""

import dataclasses
import sys
import time
from collections.abc import Callable

import jax
from study import TINY, Result, Study, run_study, table, words

from surrogate import FIDELITIES, Family, Scene
from surrogate.devices import choose_devices
from surrogate.training.loop import make_setup, run_training
from surrogate.training.plan import make_plan

COUNTS, STEPS = (256, 1024, 4096), 12
BETAS = {f"beta{k}": (-0.24 / k, 0.24 / k) for k in range(5, 10)}  # with beta2 to beta4


def measure(tiny: bool, progress: Callable, devices: int) -> Result:
    """Train by HIG on growing sets; the network's steps are few, the bodies many."""
    if devices > 1:
        jax.config.update("jax_num_cpu_devices", devices)
    family = Family(**dict(Family().ranges), **BETAS)
    scene = Scene(family=family, fidelity=TINY if tiny else FIDELITIES["draft"])
    mesh, rows = choose_devices(devices), []
    for count in COUNTS if not tiny else (8,):
        progress(len(rows) / len(COUNTS), f"{count} bodies")
        plan = make_plan(scene, "hig", "full", count)
        steps = {"iterations": 2 if tiny else STEPS, "report_every": 1}
        plan = dataclasses.replace(plan, held_out=4 if tiny else 128, **steps)
        begin = time.perf_counter()
        bench = make_setup(plan, mesh)
        method = dataclasses.replace(plan.make_method(), batch=count)
        trained = run_training(plan, bench, method=method)
        first, last = trained.history[0], trained.history[-1]
        rows.append(
            {
                "bodies": count,
                "flows_s": bench.setup_s + first.seconds,
                "step_s": (last.seconds - first.seconds) / (len(trained.history) - 1),
                "green_applications": last.green_applications,
                "waiting": trained.idle_work / last.green_applications,
                "error_mean": last.error_mean,
                "error_max": last.error_max,
                "seconds": time.perf_counter() - begin,
            }
        )
    return {"parameters": len(family.names), "devices": devices, "rows": rows}


HEADS = "bodies | flows and slopes | waiting | a step of the network | error: mean | max | all"
FORMS = "{bodies} | {flows_s:.0f} s | {waiting:.1%} | {step_s:.2f} s | {error_mean:.3%} | "
FORMS += "{error_max:.2%} | {seconds:.0f} s"


def tables(result: Result) -> str:
    """One row a set."""
    form = (
        "Sets of bodies of {parameters} parameters on the draft grid, spread over {devices} "
        "devices; HIG of {steps} steps, so errors are not what a full training reaches. Flows "
        "are solved in the first step; 'all' includes compilation and held-out flows."
    )
    return words(form, steps=STEPS, **result) + "\n\n" + table(result["rows"], HEADS, FORMS)


OPTIONS = {"--devices": {"type": int, "default": 1, "help": "CPU cores to spread bodies over (1)"}}
STUDY = Study("shards", measure, tables, options=OPTIONS)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
