"""Lowered programs: a later process finds them in files, and never another program's."""

import json
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from surrogate import lowering, program_files
from surrogate.compilation import compiled

DRAG = """
import json, jax, numpy as np
from surrogate import Fidelity, Flow, Scene
seen = []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, seconds, **more: seen.append(more.get("fun_name")) if "mlir" in event else None
)
flow = Flow(Scene(fidelity=Fidelity("kept", 8, 2.5, 4, 4, 5, wake=0.0)))
found = flow.loads_and_gradients(np.array([2.0, 0.1, 0.0, 0.0]), 10.0)
print(json.dumps({"drag": float(found.drag), "slope": found.gradients.tolist(), "lowered": seen}))
"""


@compiled("power")
def sum_of_powers(values, power):
    return {"sum": jnp.sum(values["x"] ** power), "values": values}


@pytest.fixture
def files(tmp_path, monkeypatch):
    """The folder of the files, with no program in memory."""
    monkeypatch.setattr(program_files, "folder", lambda: tmp_path / "lowered")
    monkeypatch.setattr(program_files, "OWN", {"surrogate", __name__})
    return tmp_path / "lowered"


def lower(power=2, count=3):
    return lowering.lowered(
        sum_of_powers.__wrapped__, {"power": power}, {"values": {"x": np.arange(float(count))}}
    )


def test_a_program_is_read_from_its_file(files, monkeypatch):
    first = lower()
    assert len(list(files.iterdir())) == 1
    monkeypatch.setattr(lowering, "_lower", None)  # to lower it anew would fail
    again = lower()
    assert again.result == first.result == {"sum": 0, "values": {"x": 1}}
    assert [float(x) for x in again.program.call(np.array([1.0, 2.0, 3.0]))[:1]] == [14.0]


@pytest.mark.parametrize("change", [{"power": 3}, {"count": 4}, "source", "precision"])
def test_another_program_has_another_file(files, monkeypatch, change):
    lower()
    if change == "source":
        monkeypatch.setattr(program_files, "_code", lambda: b"edited")
        lower()
    elif change == "precision":
        with jax.default_matmul_precision("float32"):
            lower()
    else:
        lower(**change)
    assert sum(path.is_file() for path in files.iterdir()) == 2


def test_a_damaged_file_is_replaced(files):
    lower()
    (path,) = files.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    assert lowering._read(path) is None
    assert lower().result == {"sum": 0, "values": {"x": 1}}
    assert lowering._read(path).result == {"sum": 0, "values": {"x": 1}}


def test_a_file_that_cannot_be_understood_is_replaced(files):
    lower()
    (path,) = files.iterdir()
    program_files.write_content(path, b"no pickle")  # with its digest
    assert lowering._read(path) is None
    assert lower().result == {"sum": 0, "values": {"x": 1}}
    assert lowering._read(path).result == {"sum": 0, "values": {"x": 1}}


def test_files_that_were_not_used_for_longest_are_removed(files, monkeypatch):
    for power in (5, 4, 3):
        lower(power)
    for path in files.iterdir():
        os.utime(path, (1e9, 1e9))
    lower(5)  # its use renews it
    monkeypatch.setattr(program_files, "LARGEST", 2.5 * path.stat().st_size)
    (path.parent / ".part-of-a-killed-process").mkdir()
    lower(6)
    assert sum(path.is_file() for path in files.iterdir()) == 2
    monkeypatch.setattr(lowering, "_lower", None)
    assert lower(5).result == lower(6).result


def test_without_a_writable_folder_programs_are_lowered(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(program_files, "OWN", {"surrogate", __name__})
    monkeypatch.setattr(program_files, "folder", lambda: tmp_path / "file" / "lowered")
    assert lower().result == {"sum": 0, "values": {"x": 1}}


@pytest.mark.parametrize("case", ["edited", "removed", "a lambda", "of a script"])
def test_programs_without_a_unique_name_have_no_file(files, monkeypatch, case):
    """What runs after an edit is the code of before, which the file's text no longer shows."""
    if case == "edited":
        monkeypatch.setattr(program_files, "LOADED", 0.0)
    elif case == "removed":
        monkeypatch.setattr(program_files, "_sources", lambda: ([files / "gone.py"], b""))
    elif case == "of a script":
        monkeypatch.setattr(program_files, "OWN", {"surrogate"})
    if case == "a lambda":
        assert lowering.lowered(lambda x: 2 * x, {}, {"x": np.ones(3)}) is None
    else:
        assert lower() is None
    assert not files.exists()


def applied(function, x):
    return function(x)


@pytest.mark.parametrize(("module", "kept"), [("__main__", False), (__name__, True)])
def test_static_functions_of_scripts_have_no_file(files, monkeypatch, module, kept):
    """Only their names are stored, and scripts are not among the source code."""
    monkeypatch.setattr(halved, "__module__", module)
    found = lowering.lowered(applied, {"function": halved}, {"x": np.ones(3)})
    assert (found is not None) == files.exists() == kept


def with_a_callback(x):
    jax.debug.print("x = {}", x)
    return 2 * x


def test_callbacks_are_traced(files):
    traced = lowering.from_file(with_a_callback, ())
    assert jax.jit(traced)(np.ones(2)).tolist() == [2.0, 2.0]


def test_without_jit_functions_run_in_python():
    with jax.disable_jit():
        found = sum_of_powers({"x": np.ones(2)}, 2)
    assert isinstance(found["values"]["x"], np.ndarray)


def test_weak_types_do_not_reach_other_runs(files):
    first = jax.jit(lowering.from_file(halved, ()))(2.0)
    again = jax.jit(lowering.from_file(halved, ()))(2.0)
    assert first.dtype == again.dtype == np.float64
    assert not first.weak_type
    assert not again.weak_type


def halved(x):
    return jnp.where(x > 0, x / 2, 0.0)


def test_compiled_functions_equal_those_of_jit(files):
    values = {"x": np.array([1.0, 2.0, 3.0])}
    found = sum_of_powers(values, power=2)
    assert float(found["sum"]) == 14.0
    assert found["values"]["x"].tolist() == [1.0, 2.0, 3.0]
    slope = jax.grad(lambda x: sum_of_powers({"x": x}, 3)["sum"])(jnp.ones(2))
    assert slope.tolist() == [3.0, 3.0]
    assert float(sum_of_powers({"x": np.ones(2, np.float32)}, 2)["sum"]) == 2.0
    assert sum(path.is_file() for path in files.iterdir()) == 2


@pytest.mark.slow
def test_a_later_process_lowers_no_flow_and_finds_the_same_bits(tmp_path):
    """And so does a process that keeps no files, with the compiler's options that users have."""
    home = os.environ | {"XDG_CACHE_HOME": str(tmp_path), "XLA_FLAGS": ""}
    off = {"JAX_ENABLE_COMPILATION_CACHE": "false"}
    runs = [
        subprocess.run(
            [sys.executable, "-c", DRAG], env=home | more, check=True, stdout=subprocess.PIPE
        )
        for more in ({}, {}, off)
    ]
    cold, warm, alone = (json.loads(run.stdout) for run in runs)
    assert "jit(program)" in cold["lowered"]
    assert "jit(program)" not in warm["lowered"]
    assert cold["drag"] == warm["drag"] == alone["drag"]
    assert cold["slope"] == warm["slope"] == alone["slope"]
