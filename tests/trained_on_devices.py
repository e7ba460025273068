"""Run by test_devices: small trainings by some methods on a number of CPU devices."""

import dataclasses
import shutil
import sys
from pathlib import Path

import jax

import surrogate  # noqa: F401  (64-bit numbers)

count, folder, checkpoint = int(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3])
methods = sys.argv[4:]
jax.config.update("jax_num_cpu_devices", count)

import numpy as np  # noqa: E402

from surrogate import Fidelity, Scene  # noqa: E402
from surrogate.devices import choose_devices  # noqa: E402
from surrogate.training.loop import load_errors, run_training  # noqa: E402
from surrogate.training.plan import Plan  # noqa: E402
from surrogate.training.setup import make_setup  # noqa: E402

scene = Scene(fidelity=Fidelity("tiny", 8, 2.5, 4, 4, 5))
plan = Plan(methods[0], scene, samples=13, held_out=5, iterations=14, report_every=2)
setup = make_setup(plan, choose_devices(count))


def keep_checkpoint(point, done):
    """Copy the checkpoint of iteration 2, the last that is written before this report."""
    if point.iteration == 4:
        shutil.copy(folder / "checkpoint", checkpoint)


folder.mkdir()
weights = {}
if checkpoint.exists():  # of the run on another number of devices
    weights["resumed"] = run_training(plan, setup, checkpoint).network.weights
    run = run_training(plan, setup)
else:
    own = folder / "checkpoint"
    run = run_training(plan, setup, own, keep_checkpoint, checkpoint_every_s=0.0)
weights[plan.method] = run.network.weights
for method in methods[1:]:
    run = run_training(dataclasses.replace(plan, method=method), setup)
    weights[method] = run.network.weights
np.savez(folder / "weights.npz", **weights)
initial = load_errors(setup.network, setup.held_out, setup.labels.loads)[:, 0].mean()
np.save(folder / "errors.npy", [initial, run.history[-1].error_mean])  # of the last method
