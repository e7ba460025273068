"""Settings and fixtures of all tests: array shapes and types are checked at run time."""

import contextlib
import functools
import gc
import importlib.metadata
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # NumPy's threads spin on the other's core
# Each operation of a program would carry its line of Python, for a tenth of the tests' time.
os.environ.setdefault("JAX_TRACEBACK_IN_LOCATIONS_LIMIT", "0")
os.environ.setdefault("JAX_INCLUDE_FULL_TRACEBACKS_IN_LOCATIONS", "0")

from jaxtyping import config, install_import_hook

if importlib.metadata.version("jaxlib").startswith("0.10."):  # XLA aborts at unknown flags
    quick = "--xla_cpu_use_fusion_emitters=false --xla_backend_optimization_level=0"
    quick += " --xla_cpu_parallel_codegen_split_count=1"  # as other tests have the other core
    os.environ.setdefault("XLA_FLAGS", quick)  # compiles 8 times as fast, runs at half speed

gc.set_threshold(100_000)  # else garbage collection takes a tenth of the time, by what JAX traces
hook = install_import_hook(["surrogate", "shapeopt"], "typecheck.check")

import jax  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402

from surrogate import Family, Fidelity, Scene, Unbounded, load  # noqa: E402
from surrogate.flow.grid.domain_2d import Domain2D  # noqa: E402

TESTS = Path(__file__).parent
SCRIPTS = TESTS.parent / "scripts"
sys.path[:0] = map(str, (SCRIPTS, SCRIPTS / "measure", TESTS / "oracles"))

TINY = Fidelity("tiny", 8, 2.5, 4, 4, 5, wake=0.0)  # for tests: small, real in every part
SECTIONS = Family(aspect=(1.5, 4), beta2=(-0.2, 0.2), gamma2=(-0.3, 0.3), incidence=(-4, 12))
ARCHED = Family(aspect=(1.5, 3), gamma2=(-0.3, 0.3), incidence=(-4, 12))
ROUGH_3D = Fidelity("rough", 5, 3, 4, 4, harmonics=5, wake=0.0, tolerance=0.1)  # the same in 3-D
SHARING = {  # files of tests that share programs
    "symmetric": "designer explore explore_clicks folders front gradients hints infill pictures "
    "plan problems refusals shapeopt streams training",
    "sections": "by_chord camber commands crosscheck error_estimate fields flow golden labels lift "
    "lift_models multipoint sections tunnel",
    "space": "3d_bodies 3d_commands 3d_designs 3d_flow 3d_incidence 3d_settling",
}
MOST_MAPS = 50_000  # memory maps of a process, of 65530
COMPILED = "/jax/core/compile/backend_compile_duration"


def group_of(file: str | Path) -> str:
    """Return the name of the tests that one worker runs together with those of a file."""
    name = Path(file).stem.removeprefix("test_")
    return next((group for group, files in SHARING.items() if name in files.split()), name)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Let one worker run the files that share programs.

    xdist's own ``--dist loadgroup`` gives every test to either worker under pytest 9.2, of which
    node identifiers cannot be changed.
    """
    if config.getvalue("dist") != "loadscope":
        return None  # another schedule is asked for
    from xdist.scheduler import LoadScopeScheduling

    class Groups(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            return group_of(nodeid.split("::")[0])

    return Groups(config, log)


def pytest_collection_modifyitems(items):
    """Let files that clear JAX's caches come first, and in a file the tests that do so last."""
    clearing = {item.path for item in items if "compiled" in item.fixturenames}

    def place(item):
        group, clears = group_of(item.path), "compiled" in item.fixturenames
        return item.path not in clearing, group not in SHARING, group, item.path, clears

    items.sort(key=place)


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item, nextitem):
    """Between files drop compiled code before its memory maps are too many."""
    if nextitem is None or nextitem.path == item.path:
        return
    maps = Path("/proc/self/maps")
    if not maps.exists() or maps.read_text().count("\n") > MOST_MAPS:
        jax.clear_caches()


@pytest.fixture(scope="session")
def tiny_scene() -> Scene:
    return Scene(fidelity=TINY)


@pytest.fixture(scope="session")
def cylinder_domain():
    return Domain2D.make(Unbounded(), TINY, (1.5, 1.5), symmetric=True)


@pytest.fixture(scope="session", autouse=True)
def no_lowered_files():
    """Lowered programs stay in memory: tests replace constants on which these depend."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("surrogate.program_files.folder", lambda: None)
        patch.setattr("surrogate.compilation.MOST_MAPS", 0.85)  # beyond that of the tests
        yield


@pytest.fixture
def generator() -> np.random.Generator:
    return np.random.default_rng(0)


@contextlib.contextmanager
def without_estimates():
    """Solve flows without estimates of their errors, which take two more grids."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("surrogate.flow.flow.with_estimate", lambda scene, settings, found: found)
        yield


@pytest.fixture
def no_estimates():
    with without_estimates():
        yield


shipped = functools.cache(load)  # the preparation of error bounds takes seconds


@pytest.fixture
def shipped_once(monkeypatch):
    """Let predict_drag.py load every shipped surrogate once."""
    monkeypatch.setattr("shapeopt.commands.predict_drag.load", shipped)


@pytest.fixture
def compilations():
    """A list of the functions that JAX compiles or loads from its cache during the test."""
    seen = []

    def listen(event, seconds, **more):
        if event == COMPILED:
            seen.append(more.get("fun_name", "?"))

    jax.monitoring.register_event_duration_secs_listener(listen)
    jax.jit(lambda x: x + 1)(1.0)
    assert seen, "JAX reports compilations by another event"
    seen.clear()
    yield seen
    jax.monitoring.unregister_event_duration_listener(listen)


@pytest.fixture
def compiled(compilations):
    """The same list, of all that a test takes in a new process, whatever others have compiled."""
    jax.clear_caches()
    return compilations


@pytest.fixture
def unchecked():
    """Switch the run-time type checks off, so that the library's own messages are seen."""
    config.update("jaxtyping_disable", True)
    yield
    config.update("jaxtyping_disable", False)


def pytest_unconfigure():
    hook.uninstall()
