"""After kill -9 at any moment the same command again gives the same result."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from pictures import pixels

ROOT = Path(__file__).parents[1]
SCENE = """
stream = "tunnel:12"
reynolds = [5, 45]
fidelity = {name = "tiny", cells = 8, upstream = 2.5, downstream = 4, height = 4, harmonics = 5}
[family]
aspect = [1, 3]
beta2 = [-0.2, 0.2]
"""
COMMANDS = {  # of folders of their own; {run} is a run that was kept before
    "train": "train_surrogate.py --method sip --scene {scene} --samples 24 --out {out}/trained",
    "payoff": "payoff.py --scene {scene} --samples 8 --queries 2 --out {out}/payoff",
    "optimise": "optimize_shape.py --surrogate none --scene {scene} --reynolds 40 --out {out}/run",
    "render": "render_shapes.py --runs {run} --out {out}/shapes.gif",
}
TIME = re.compile(r"(^|_)s(_|$)|seconds|extrapolated")  # keys of durations
KILLS = 5  # of each command


def start(command, **places):
    script, *arguments = command.format(**places).split()
    words = [sys.executable, str(ROOT / "scripts" / script), *arguments]
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def finish(process):
    _, said = process.communicate()
    assert process.returncode == 0, said


def outcome(out):
    """The contents of all files that a command leaves, without times, paths and command lines.

    Partial files of a killed process (.part-) are left out.
    """
    left = {str(path.relative_to(out)): path for path in sorted(out.rglob("*")) if path.is_file()}
    return {n: _content(n, path, str(out)) for n, path in left.items() if ".part-" not in n}


def _content(name, path, out):
    if path.suffix == ".json":
        return _timeless(json.loads(path.read_text().replace(out, "")))
    if path.suffix in (".png", ".gif"):
        return None if "payoff" in name else pixels(path)[1].tobytes()  # its plot is over seconds
    return path.read_bytes()


def _timeless(value):
    if isinstance(value, list):
        return [_timeless(part) for part in value]
    if not isinstance(value, dict):
        return value
    if "history" in value:  # of a training: step, seconds, and what had come of it
        value = value | {"history": [[*point[:1], *point[2:]] for point in value["history"]]}
    kept = (key for key in value if key not in ("command", "date") and not TIME.search(key))
    return {key: _timeless(value[key]) for key in kept}


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    folder = tmp_path_factory.mktemp("before")
    (folder / "scene.toml").write_text(SCENE)
    known = {"scene": folder / "scene.toml", "run": folder / "run"}
    finish(start(COMMANDS["optimise"], out=folder, **known))
    return known


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_killed_at_random_moments_the_same_command_comes_to_the_same(
    name, places, tmp_path, generator
):
    whole = tmp_path / "whole"
    whole.mkdir()
    begin = time.monotonic()
    finish(start(COMMANDS[name], out=whole, **places))
    seconds, expected = time.monotonic() - begin, outcome(whole)
    killed = 0
    for k, moment in enumerate(generator.uniform(0.1, 0.95, KILLS)):
        out = tmp_path / str(k)
        out.mkdir()
        process = start(COMMANDS[name], out=out, **places)
        try:
            process.wait(moment * seconds)
        except subprocess.TimeoutExpired:
            os.kill(process.pid, signal.SIGKILL)
            killed += process.wait() == -signal.SIGKILL
        process.stderr.close()
        finish(start(COMMANDS[name], out=out, **places))
        assert outcome(out) == expected, f"killed after {moment:.0%}"
    assert killed >= KILLS - 2  # the others were faster than the first


SCRIPT = Path(__file__).with_name("killed_training.py")


def training(folder):
    folder.mkdir(exist_ok=True)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    words = [sys.executable, str(SCRIPT), str(folder)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment)


@pytest.mark.slow
def test_killed_and_resumed_training_is_bit_identical(tmp_path, generator):
    """Killed by SIGKILL some time after a random step; it resumes from its checkpoint."""
    whole = training(tmp_path / "whole")
    killed = training(tmp_path / "killed")
    last = int(generator.integers(3, 40))
    for line in killed.stdout:
        if int(line) >= last:
            os.kill(killed.pid, signal.SIGKILL)
            break
    assert killed.wait() == -signal.SIGKILL
    assert not (tmp_path / "killed" / "weights.npy").exists()
    assert (tmp_path / "killed" / "checkpoint").exists()

    resumed = training(tmp_path / "killed")
    steps = [int(line) for line in resumed.stdout]
    assert resumed.wait() == 0
    assert steps[0] > 2, "it started again instead of going on"
    for line in whole.stdout:
        assert int(line) > 0
    assert whole.wait() == 0
    weights = [np.load(tmp_path / name / "weights.npy") for name in ("whole", "killed")]
    assert np.array_equal(*weights)
