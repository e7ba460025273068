"""Few programs are compiled, they are shared, and later processes load them from JAX's cache."""

import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from shapeopt.commands.predict_drag import main as predict_drag
from surrogate import Fidelity, Flow, Scene, compilation, contour_shape
from surrogate.cache import use_compilation_cache
from surrogate.compilation import compiled as compiled_by_us

LENS = np.array([2.0, 0.1, 0.0, 0.0])
CACHED = """
import jax, surrogate
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.jit(lambda x: x @ x)(jax.numpy.ones((3, 3)))
"""


def test_drag_gradient_and_solution_share_their_programs(compiled):
    flow = Flow(Scene(fidelity=Fidelity("shared", 8, 2.5, 4, 4, 5, wake=0.0)))
    drag = flow.drag(LENS, 10.0)
    assert compiled.count("jit(body_flow)") == compiled.count("jit(assemble)") == 1
    gradient = jax.grad(flow.drag)(jnp.array(LENS), 10.0)  # JAX compiles anew inside of a rule
    rule = compiled.count("jit(body_flow)")
    slope = flow.loads_and_gradients(LENS, 10.0)
    solution = flow.solve(LENS, 10.0, gradient=True, estimate=False)
    assert compiled.count("jit(body_flow)") == compiled.count("jit(assemble)") == rule <= 2
    assert compiled.count("jit(load_gradients)") == 2  # to full precision, and to that of designs
    assert float(drag) == float(slope.drag) == solution.drag
    assert list(solution.gradient.values())[:4] == pytest.approx(gradient.tolist(), rel=1e-6)
    before = len(compiled)
    assert np.isfinite(solution.surface().cp).all()
    assert len(compiled) - before <= 12  # by which a surface is drawn


def test_vmap_alone_compiles_whole_programs(compiled):
    """Not every operation of the flow apart, and nothing at the second call."""
    flow = Flow(Scene(fidelity=Fidelity("shared", 8, 2.5, 4, 4, 5, wake=0.0)))
    bodies, numbers = jnp.stack([LENS, LENS]), jnp.array([10.0, 20.0])
    drags = jax.vmap(flow.drag)(bodies, numbers)
    # the far field is in single precision, and rounded otherwise in a batch on some processors
    assert float(drags[0]) == pytest.approx(float(flow.drag(LENS, 10.0)), rel=1e-7)
    before = len(compiled)
    assert before <= 250
    assert jax.vmap(flow.drag)(bodies, numbers).tolist() == drags.tolist()
    assert len(compiled) == before


def test_a_prediction_takes_few_programs_and_another_one_none(compiled, capsys):
    """Most are compiled anew in every process, as each takes less time than its file is worth."""
    arguments = ["--aspect", "2", "--beta2", "0.1", "--reynolds"]
    for reynolds, most in (("20", 32), ("5,30", 0)):
        compiled.clear()
        predict_drag([*arguments, reynolds])
        assert len(compiled) <= most
    assert "Re 30" in capsys.readouterr().out


@compiled_by_us("power")
def to_a_power(x, power):
    return x**power


@pytest.mark.parametrize(("share", "kept"), [(0.6, 1), (0.0, 0)])
def test_programs_are_dropped_where_their_memory_maps_are_too_many(monkeypatch, share, kept):
    """A process crashes at 65,530 of them, as a study of 210 grids did."""
    if not Path("/proc/self/maps").exists():
        pytest.skip("Linux alone limits them so")
    jax.clear_caches()
    monkeypatch.setattr(compilation, "MOST_MAPS", share)
    dropped = []
    monkeypatch.setattr(jax, "clear_caches", lambda: dropped.append(1))
    assert float(to_a_power(jnp.array(3.0), 2)) == 9.0
    assert len(dropped) == 1 - kept
    assert float(to_a_power(jnp.array(2.0), 2)) == 4.0  # nothing is compiled, nothing dropped
    assert len(dropped) == 1 - kept


def random_contour(generator: np.random.Generator) -> np.ndarray:
    t = np.linspace(0, 2 * np.pi, generator.integers(60, 300), endpoint=False)
    waves = generator.uniform(-0.3, 0.3, 2) @ np.stack([np.cos(t), np.cos(2 * t)])
    camber = generator.uniform(-0.1, 0.1) * np.sin(t) ** 2
    y = np.sin(t) * (1 + waves) / generator.uniform(2, 8) + camber
    return np.stack([-np.cos(t) / 2, y], axis=1)


@pytest.mark.slow
def test_thirty_contours_compile_a_few_times(compiled, generator):
    flow, solves = Flow(Scene(fidelity=Fidelity("few", 10, 4, 8, 8, 5))), []
    for _ in range(30):
        shape = contour_shape(random_contour(generator), generator.uniform(-20, 20))
        before, reynolds = len(compiled), np.exp(generator.uniform(0, np.log(45)))
        flow.solve(shape, reynolds, estimate=False, allow_unsteady=True)
        solves.append(len(compiled) > before)
    assert sum(solves) <= 5
    assert (
        compiled.count("jit(body_flow)") <= 9
    )  # three domains of a flow and of the two of its estimate


@pytest.mark.parametrize("enabled", [True, False])
def test_the_cache_is_on_by_default_and_is_turned_off_by_jax(tmp_path, enabled):
    switch = {} if enabled else {"JAX_ENABLE_COMPILATION_CACHE": "false"}
    home = os.environ | {"XDG_CACHE_HOME": str(tmp_path)} | switch
    subprocess.run([sys.executable, "-c", CACHED], env=home, check=True)
    assert any(tmp_path.rglob("*-cache")) == enabled


SETTINGS = """
import os, jax, surrogate
print(jax.config.jax_compilation_cache_dir, jax.config.jax_persistent_cache_min_compile_time_secs)
print(os.environ["OPENBLAS_THREAD_TIMEOUT"])
"""


@pytest.mark.parametrize(("seconds", "kept"), [(None, "0.1"), ("5", "5.0")])
def test_a_moved_cache_keeps_short_programs_too(tmp_path, seconds, kept):
    """And the user's own time-out of OpenBLAS's idle threads stays."""
    home = os.environ | {"JAX_COMPILATION_CACHE_DIR": str(tmp_path)}
    home["OPENBLAS_THREAD_TIMEOUT"] = "9"
    if seconds:
        home["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = seconds
    ran = subprocess.run(
        [sys.executable, "-c", SETTINGS], env=home, check=True, stdout=subprocess.PIPE
    )
    assert ran.stdout.decode().split() == [str(tmp_path), kept, "9"]


def test_the_cache_that_a_user_has_set_stays(tmp_path):
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", str(tmp_path / "mine"))
    try:
        use_compilation_cache()
        assert jax.config.jax_compilation_cache_dir == str(tmp_path / "mine")
    finally:
        jax.config.update("jax_compilation_cache_dir", before)


def test_an_entry_without_its_time_stamp_gets_one(tmp_path, monkeypatch):
    """A process that was killed between the two would end all removal from the cache."""
    folder = tmp_path / "drag-surrogates" / "compiled"
    folder.mkdir(parents=True)
    (folder / "program-cache").write_bytes(b"")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", None)
    try:
        use_compilation_cache()
        assert len((folder / "program-atime").read_bytes()) == 8
    finally:
        jax.config.update("jax_compilation_cache_dir", before)


def test_without_a_home_there_is_no_cache(monkeypatch):
    """As in a container whose user has neither HOME nor an entry in passwd."""

    def home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", home)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", None)
    try:
        use_compilation_cache()
        assert jax.config.jax_compilation_cache_dir is None
    finally:
        jax.config.update("jax_compilation_cache_dir", before)
