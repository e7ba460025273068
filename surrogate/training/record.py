"""The record of a training, stored in the surrogate's folder."""

import sys
from pathlib import Path

from surrogate.model.surrogate import Surrogate
from surrogate.training.loop import TrainingResult, TrainingSetup
from surrogate.training.plan import Plan


def surrogate_of(plan: Plan, trained: TrainingResult, setup: TrainingSetup) -> Surrogate:
    """The surrogate of a finished training, with its record."""
    last = trained.history[-1]
    record = {
        "method": plan.method,
        "trained_for": "traction" if plan.make_method().trains_traction else "drag",
        "drag_error_mean": last.error_mean,
        "drag_error_max": last.error_max,
        "green_applications": last.green_applications,
        "train_s": last.seconds,
        "weights": int(trained.network.weights.size),
        "command": command_line(),
        "setup_s": setup.setup_s,
        "compile_s": setup.compile_s + trained.compile_s,
        "devices": setup.physics.partition.devices.count,
        "waiting": trained.idle_work,
        "published": plan.published,
        "seed": plan.seed,
        "samples": plan.samples,
        "held_out": plan.held_out,
        "held_out_failed": setup.held_out_failed,
        "budget_s": plan.budget_s,
        "iterations": last.iteration,
        "failed_samples": last.failed,
        "stopped": trained.stopped,
        "history": [list(point[:5]) for point in trained.history],
    }
    return Surrogate(trained.network, plan.scene, record)


def matches_plan(plan: Plan, surrogate: Surrogate) -> bool:
    """Whether a surrogate is the result of this plan's training, not interrupted."""
    record = surrogate.record
    keys = ("method", "published", "samples", "held_out", "seed", "budget_s")
    planned = tuple(getattr(plan, key) for key in keys)
    recorded = tuple(record.get(key) for key in keys)
    done = record.get("iterations") == plan.iterations or plan.budget_s is not None
    finished = done or record.get("stopped") is not None
    return recorded == planned and surrogate.scene == plan.scene and finished


def command_line() -> str:
    """The command that is running, as stored with its result."""
    name = Path(sys.argv[0]).name
    return " ".join([f"python scripts/{name}" if name.endswith(".py") else name, *sys.argv[1:]])
