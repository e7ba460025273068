"""Run by test_killed and test_devices: a training with checkpoints at every report, to be killed.

killed_training.py FOLDER [HOST:PORT PROCESSES PROCESS]
"""

import sys
from pathlib import Path

import numpy as np

from surrogate import Fidelity, Scene
from surrogate.processes import first, join
from surrogate.training.loop import run_training
from surrogate.training.plan import Plan
from surrogate.training.setup import make_setup

folder, together = Path(sys.argv[1]), sys.argv[2:]
if together:
    join(together[0], *map(int, together[1:]))
scene = Scene(fidelity=Fidelity("tiny", 8, 2.5, 4, 4, 5))
plan = Plan("sip", scene, samples=24, held_out=4, iterations=60, report_every=1)


def announce(point, done):
    print(point.iteration, flush=True)


trained = run_training(
    plan, make_setup(plan), folder / "checkpoint", announce, checkpoint_every_s=0.0
)
if first():
    np.save(folder / "weights.npy", np.asarray(trained.network.weights))
