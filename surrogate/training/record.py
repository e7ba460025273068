"""The record of a training, stored in the surrogate's folder."""

import json
import zlib

import numpy as np

from surrogate.devices import Devices
from surrogate.files import JsonObject
from surrogate.flow.flow import Flow
from surrogate.model.confidence import Novelty, error_scales
from surrogate.model.evaluation import novelty_of_loads
from surrogate.model.outputs import LOAD_NAMES
from surrogate.model.surrogate import Surrogate
from surrogate.repeats import differences
from surrogate.scene.scene import Scene
from surrogate.training.held_out import Report, solve_held_out
from surrogate.training.history import load_errors
from surrogate.training.loop import TrainingResult
from surrogate.training.plan import Plan
from surrogate.training.setup import TrainingSetup
from surrogate.versions import command_line

SETTINGS = {  # of a plan and of a record, as messages call them
    "method": "method",
    "published": "published",
    "samples": "samples",
    "held_out": "held-out bodies",
    "seed": "seed",
    "width": "width",
    "budget_s": "budget in seconds",
}


def surrogate_of(
    plan: Plan, trained: TrainingResult, setup: TrainingSetup, notes: JsonObject | None = None
) -> Surrogate:
    """Return the surrogate of a finished training, with its record.

    Args:
      plan: of the training.
      trained: its result.
      setup: from which it started; its held-out flows give the errors and their bounds.
      notes: added to the record.
    """
    last = trained.history[-1]
    record = {
        "method": plan.method,
        "trained_for": "traction" if plan.make_method().trains_traction else "drag",
        **_errors(plan, trained.network, setup.held_out, setup.labels.loads),
        "green_applications": last.green_applications,
        "earlier_green_applications": plan.earlier_green_applications,
        "train_s": last.seconds,
        "weights": int(trained.network.weights.size),
        "command": command_line(),
        "setup_s": setup.setup_s,
        "compile_s": setup.compile_s + trained.compile_s,
        "devices": setup.physics.partition.devices.count,
        "idle_work": trained.idle_work,
        "published": plan.published,
        "seed": plan.seed,
        "samples": plan.samples,
        "infill": list(plan.infill),
        "symmetric_share": plan.symmetric_share,
        "held_out": plan.held_out,
        "held_out_failed": setup.held_out_failed,
        "budget_s": plan.budget_s,
        "iterations": last.iteration,
        "failed_samples": last.failed,
        "unsolved_samples": trained.unsolved,
        "beyond_onset": _beyond_onset(setup.physics),
        "stopped": trained.stopped,
        "history": [list(point[:5]) for point in trained.history],
        **(notes or {}),
    }
    return Surrogate(trained.network, plan.scene, record)


def _beyond_onset(physics):
    """Return how many training samples are beyond the onset of instability of their flow."""
    onsets = physics.flow.bodies.check(np.asarray(physics.samples.parameters)).onset
    return int(np.sum(np.asarray(physics.samples.reynolds) > onsets))


def measured_anew(plan: Plan, surrogate: Surrogate, devices: Devices, report: Report) -> Surrogate:
    """Return a surrogate with its errors, and their bounds, on the held-out bodies of a plan.

    Args:
      plan: of its training, but for the number of held-out bodies.
      surrogate: what was trained.
      devices: over which the flows are distributed.
      report: as of ``make_setup``.

    Raises:
      NotConverged: more than a tenth of the held-out flows, at least two, or all of them did not
        converge.
    """
    held_out, labels = solve_held_out(Flow(plan.scene), plan, devices, report)
    record = surrogate.record | _errors(plan, surrogate.network, held_out, labels.loads)
    record |= {"held_out": plan.held_out, "held_out_failed": plan.held_out - held_out.count}
    return Surrogate(surrogate.network, plan.scene, record | {"errors_command": command_line()})


def _errors(plan, network, held_out, loads):
    """Return the errors of loads on held-out bodies, over Cd, and the scales of their bounds."""
    errors = np.asarray(load_errors(network, held_out, loads))
    novelty = Novelty.of_answers(network, plan.training_samples)
    found = novelty_of_loads(novelty, *map(np.asarray, held_out))
    scales = error_scales(errors, found[:, : errors.shape[1]])
    p95 = np.percentile(errors, 95, axis=0)
    measures = {"mean": errors.mean(0), "p95": p95, "max": errors.max(0), "scale": scales}
    return {
        f"{name}_error_{kind}": float(value)
        for kind, values in measures.items()
        for name, value in zip(LOAD_NAMES, values, strict=False)
    }


def plan_differences(plan: Plan, record: JsonObject) -> str:
    """Return in words how the training of a surrogate's record differs from a plan; "" if not.

    Raises:
      InvalidInput: the record has no valid scene.
    """
    stored = {name: record.get(key) for key, name in SETTINGS.items()}
    asked = {name: getattr(plan, key) for key, name in SETTINGS.items()}
    sizes = record.get("sizes")
    stored["width"] = sizes[0] if isinstance(sizes, list) and sizes else None
    share = "share of symmetric bodies"
    stored[share], asked[share] = record.get("symmetric_share", 0.0), plan.symmetric_share
    stored["infill"], asked["infill"] = map(_infill, (record.get("infill", ()), plan.infill))
    if not (plan.budget_s or record.get("budget_s") or record.get("stopped")):
        stored["iterations"], asked["iterations"] = record.get("iterations"), plan.iterations
    stored |= Scene.of(record.get("scene")).record
    return differences(stored, asked | plan.scene.record)


def _infill(positions):
    """Return the samples added by infill, in words; older records have none."""
    digest = zlib.crc32(json.dumps(list(positions)).encode())
    return f"{len(positions)} samples ({digest:08x})" if positions else "none"
