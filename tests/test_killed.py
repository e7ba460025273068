"""kill -9 in the middle of a training loses nothing: resumed, it ends with the same weights."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).with_name("killed_training.py")


def start(folder):
    folder.mkdir(exist_ok=True)
    environment = os.environ | {"PYTHONPATH": str(SCRIPT.parents[1])}
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), str(folder)],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )


@pytest.mark.slow
def test_killed_and_resumed_training_is_bit_identical(tmp_path, generator):
    """Killed by SIGKILL after a random step, wherever it happens to be by then."""
    whole = start(tmp_path / "whole")
    killed = start(tmp_path / "killed")
    last = int(generator.integers(3, 40))
    for line in killed.stdout:
        if int(line) >= last:
            os.kill(killed.pid, signal.SIGKILL)
            break
    assert killed.wait() == -signal.SIGKILL
    assert not (tmp_path / "killed" / "weights.npy").exists()
    assert (tmp_path / "killed" / "checkpoint").exists()

    resumed = start(tmp_path / "killed")
    steps = [int(line) for line in resumed.stdout]
    assert resumed.wait() == 0
    assert steps[0] > 2, "it started again instead of going on"
    for line in whole.stdout:
        assert int(line) > 0
    assert whole.wait() == 0
    weights = [np.load(tmp_path / name / "weights.npy") for name in ("whole", "killed")]
    assert np.array_equal(*weights)
