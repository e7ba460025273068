"""Run by test_devices: small trainings by some methods on a number of CPU devices.

Arguments are the number, the folder of the results, a checkpoint, the bodies ("symmetric" or
"sections") and the methods.
"""

import dataclasses
import shutil
import sys
from pathlib import Path

import jax

import surrogate  # noqa: F401  (64-bit numbers)

count, folder, checkpoint = int(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3])
bodies, *methods = sys.argv[4:]
jax.config.update("jax_num_cpu_devices", count)

import numpy as np  # noqa: E402

from surrogate import Family, Fidelity, Scene  # noqa: E402
from surrogate.devices import choose_devices  # noqa: E402
from surrogate.training.loop import load_errors, run_training  # noqa: E402
from surrogate.training.plan import Plan  # noqa: E402
from surrogate.training.setup import make_setup  # noqa: E402

sections = Family(aspect=(1.5, 4), beta2=(-0.2, 0.2), gamma2=(-0.3, 0.3), incidence=(-4, 12))
family = sections if bodies == "sections" else Family()
scene = Scene(family=family, fidelity=Fidelity("tiny", 8, 2.5, 4, 4, 5, wake=0.0))
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
