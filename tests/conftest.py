"""Strict settings: shapes and types of public functions are checked at run time."""

import sys
from pathlib import Path

from jaxtyping import install_import_hook

hook = install_import_hook(["surrogate", "shapeopt"], "typecheck.check")

import jax  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402

import surrogate  # noqa: E402
from surrogate.scene.scene import Fidelity, Scene, Unbounded  # noqa: E402

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))
surrogate.use_compilation_cache()

TINY = Fidelity("tiny", 8, 2.5, 4, 4, 5)  # small enough for a test, real in every part


@pytest.fixture(scope="session")
def tiny_scene() -> Scene:
    return Scene(fidelity=TINY)


@pytest.fixture(scope="session")
def cylinder_domain():
    from surrogate.flow.grid.domain import make_domain

    return make_domain(Unbounded(), TINY, (1.5, 1.5), symmetric=True)


@pytest.fixture(scope="module", autouse=True)
def memory_maps():
    """Drop a module's compiled code: Linux grants a process 65530 maps, a solver takes hundreds."""
    yield
    jax.clear_caches()


@pytest.fixture
def generator() -> np.random.Generator:
    return np.random.default_rng(0)


def pytest_unconfigure():
    hook.uninstall()
