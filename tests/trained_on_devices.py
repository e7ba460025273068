"""Run by test_devices: small trainings by every method on a number of CPU devices."""

import contextlib
import dataclasses
import sys
from pathlib import Path

import jax

import surrogate  # noqa: F401  (64-bit numbers)

count, folder, checkpoint = int(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3])
methods = sys.argv[4:]
jax.config.update("jax_num_cpu_devices", count)

import numpy as np  # noqa: E402

from surrogate import Fidelity, Scene  # noqa: E402
from surrogate.cache import use_compilation_cache  # noqa: E402
from surrogate.devices import choose_devices  # noqa: E402
from surrogate.training.loop import make_setup, run_training  # noqa: E402
from surrogate.training.plan import Plan  # noqa: E402

use_compilation_cache()
scene = Scene(fidelity=Fidelity("tiny", 8, 2.5, 4, 4, 5))
plan = Plan("sip", scene, samples=13, held_out=5, iterations=4, report_every=2)
setup = make_setup(plan, choose_devices(count))
weights = {}
for method in methods:
    run = run_training(dataclasses.replace(plan, method=method), setup)
    weights[method] = np.asarray(run.network.weights)


class Interrupted(Exception):
    """An interrupted training."""


def interrupt(point, done):
    if point.iteration == 4:
        raise Interrupted


if not checkpoint.exists():  # the written by the first run, for all others
    with contextlib.suppress(Interrupted):
        run_training(plan, setup, checkpoint, interrupt, checkpoint_every_s=0.0)
weights["resumed"] = np.asarray(run_training(plan, setup, checkpoint).network.weights)
folder.mkdir()
np.savez(folder / "weights.npz", **weights)
