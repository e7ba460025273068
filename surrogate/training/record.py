"""The record of a training: what a surrogate's folder says of how it came about."""

import sys
from pathlib import Path

from surrogate.model.surrogate import Surrogate
from surrogate.training.loop import TrainingResult, TrainingSetup
from surrogate.training.plan import Plan


def surrogate_of(plan: Plan, trained: TrainingResult, bench: TrainingSetup) -> Surrogate:
    """A finished training as a surrogate, its record complete."""
    last = trained.history[-1]
    record = {
        "method": plan.method,
        "drag_error_mean": last.error_mean,
        "drag_error_max": last.error_max,
        "green_applications": last.green_applications,
        "train_s": last.seconds,
        "weights": int(trained.network.weights.size),
        "command": command_line(),
        "setup_s": bench.setup_s,
        "compile_s": bench.compile_s + trained.compile_s,
        "devices": bench.physics.partition.devices.count,
        "waiting": trained.idle_work,
        "published": plan.published,
        "seed": plan.seed,
        "samples": plan.samples,
        "held_out": plan.held_out,
        "budget_s": plan.budget_s,
        "iterations": last.iteration,
        "failed_samples": last.failed,
        "stopped": trained.stopped,
        "history": [list(point[:5]) for point in trained.history],
    }
    return Surrogate(trained.network, plan.scene, record)


def is_of(plan: Plan, surrogate: Surrogate) -> bool:
    """Whether this is what the plan's training leaves: a whole one."""
    record = surrogate.record
    keys = ("method", "published", "samples", "held_out", "seed", "budget_s")
    asked = tuple(getattr(plan, key) for key in keys)
    found = tuple(record.get(key) for key in keys)
    done = record.get("iterations") == plan.iterations or plan.budget_s is not None
    whole = done or record.get("stopped") is not None
    return found == asked and surrogate.scene == plan.scene and whole


def command_line() -> str:
    """The command that is running, to be kept with its result."""
    name = Path(sys.argv[0]).name
    return " ".join([f"python scripts/{name}" if name.endswith(".py") else name, *sys.argv[1:]])
