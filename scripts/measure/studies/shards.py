"""Trainings on thousands of bodies with nine parameters, spread over this machine's devices."""

import dataclasses
import time

import jax
from studies.dimension import family_of
from study import TINY, Result, Row, Run, Study, Table, columns, words

from surrogate import Scene
from surrogate.devices import choose_devices
from surrogate.training.loop import make_setup, run_training
from surrogate.training.plan import make_plan

PARAMETERS, STEPS = 9, 12


def cases(run: Run) -> list[Row]:
    """Numbers of bodies; JAX is told of its devices before it first uses them."""
    if (devices := run.options["devices"]) > 1:
        jax.config.update("jax_num_cpu_devices", devices)
    return [{"bodies": count} for count in (256, 1024, 4096)]


def measure(run: Run, bodies: int) -> Row:
    """Train by HIG; the network's steps are few, the bodies many."""
    scene = Scene(family=family_of(PARAMETERS), fidelity=run.pick(TINY, "draft"))
    count, steps = run.pick((8, 2), (bodies, STEPS))
    plan = make_plan(scene, "hig", "full", count)
    shorter = {"held_out": run.pick(4, 128), "iterations": steps, "report_every": 1}
    plan = dataclasses.replace(plan, **shorter)
    begin = time.perf_counter()
    setup = make_setup(plan, choose_devices(run.options["devices"]))
    trained = run_training(plan, setup, method=plan.make_method()._replace(batch=count))
    first, last = trained.history[0], trained.history[-1]
    return {
        "flows_s": setup.setup_s + first.seconds,
        "step_s": (last.seconds - first.seconds) / (len(trained.history) - 1),
        "green_applications": last.green_applications,
        "waiting": trained.waiting / last.green_applications,
        "error_mean": last.error_mean,
        "error_max": last.error_max,
        "seconds": time.perf_counter() - begin,
    }


def text(result: Result) -> str:
    form = (
        "Bodies of {parameters} parameters on the draft grid, spread over {devices} devices; HIG "
        "of {steps} steps, so errors are not what a full training reaches. Flows are solved in "
        "the first step; the total includes compilation and held-out flows."
    )
    return words(form, steps=STEPS, **result)


COLUMNS = "bodies {bodies} | flows and slopes {flows_s:.0f} s | idle work {waiting:.1%}"
COLUMNS += " | step of the network {step_s:.2f} s | mean error {error_mean:.3%}"
COLUMNS += " | largest {error_max:.2%} | total {seconds:.0f} s"
STUDY = Study(
    [Table(cases, measure, columns(COLUMNS))],
    text,
    extra=lambda run, _: {"parameters": PARAMETERS, "devices": run.options["devices"]},
    options={"--devices": {"type": int, "default": 1, "help": "CPU devices for the bodies (1)"}},
)
