"""Commands as processes: SIGTERM, a full disk, no compilation cache."""

import contextlib
import errno
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import solve_drag

from shapeopt.commands.cli import run
from surrogate.cache import use_compilation_cache

ROOT = Path(__file__).parents[1]
PREDICTION = ["--aspect", "2", "--reynolds", "20"]


def started(script, *words, **options):
    return subprocess.Popen(
        [sys.executable, str(ROOT / "scripts" / script), *words],
        text=True,
        **({"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options),
    )


def test_a_full_disk_behind_stdout_is_reported():
    with open("/dev/full", "w") as full:
        process = started("predict_drag.py", *PREDICTION, stdout=full)
        _, messages = process.communicate()
    assert process.returncode == 4
    assert "No space left" in messages.splitlines()[-1]


def test_a_closed_stdout_is_reported():
    command = f"{sys.executable} {ROOT / 'scripts' / 'predict_drag.py'} {' '.join(PREDICTION)} >&-"
    process = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert process.returncode == 4
    assert process.stderr == "predict_drag.py: output: stdout is closed\n"


class FullDisk(io.StringIO):
    def write(self, text):
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_behind_stderr_costs_messages_alone(capsys, no_estimates):
    words = ["--aspect", "1", "--cells", "8", "--reynolds", "5,10", "--json"]
    with contextlib.redirect_stderr(FullDisk()):
        assert run(solve_drag.main, words) == 0
        assert run(solve_drag.main, [*words[:-2], "-1"]) == 2
    assert len(json.loads(capsys.readouterr().out.splitlines()[-1])["results"]) == 2


def test_a_terminated_training_ends_with_status_130_and_one_line(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'fidelity = {name = "tiny", cells = 8, upstream = 2.5, downstream = 4, height = 4, '
        "wake = 0, harmonics = 5}\n"
    )  # programs of this scene and these numbers are in the cache, by test_infill
    words = ["--method", "sip", "--samples", "16", "--budget-seconds", "600"]
    words += ["--held-out", "8", "--scene", str(scene), "--out", str(tmp_path / "hig")]
    process = started("train_surrogate.py", *words)
    for line in process.stderr:
        if " step " in line:
            break
    while process.poll() is None:  # Python drops signals that arrive in some callbacks
        process.terminate()
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            continue
    messages = process.stderr.read()
    assert process.returncode == 130
    last = "train_surrogate.py: interrupted; the same command resumes it"
    assert messages.splitlines()[-1] == last


def test_commands_run_without_a_compilation_cache(tmp_path):
    (tmp_path / "file").write_text("")
    home = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "file")}
    process = started("predict_drag.py", *PREDICTION, env=home)
    _, messages = process.communicate()
    assert (process.returncode, messages) == (0, "")


def test_an_empty_cache_home_means_the_default(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", None)
    use_compilation_cache()
    chosen = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", before)
    assert Path(chosen).is_absolute()
    assert not list(tmp_path.iterdir())
