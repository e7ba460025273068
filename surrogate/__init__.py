"""Laminar aerodynamic surrogates: a flow solver on jax-cfd, and networks trained through it.

This is the public API. ``Flow`` and ``Surrogate`` are the two models of the loads, with the same
``drag(parameters, reynolds)``. Dependencies go one way: body -> scene -> flow -> model ->
training, exports. Importing the package switches JAX to 64-bit numbers and its compilation cache on
(``cache.py``), and lets idle threads of OpenBLAS sleep (``blas.py``).
"""

import jax

jax.config.update("jax_enable_x64", True)

from surrogate.blas import let_blas_threads_sleep  # noqa: E402
from surrogate.cache import use_compilation_cache  # noqa: E402

let_blas_threads_sleep()
use_compilation_cache()

from surrogate.body.contour import naca4  # noqa: E402
from surrogate.body.contour_file import read_contour  # noqa: E402
from surrogate.body.family import Family  # noqa: E402
from surrogate.body.shape import Shape, contour_shape, family_shape  # noqa: E402
from surrogate.errors import InvalidInput, NotConverged  # noqa: E402
from surrogate.exports.export import export  # noqa: E402
from surrogate.flow.batch import FlowBatch  # noqa: E402
from surrogate.flow.derivatives import LoadsAndGradients  # noqa: E402
from surrogate.flow.flow import Flow  # noqa: E402
from surrogate.flow.forces import Forces  # noqa: E402
from surrogate.flow.settling import Particle, Settled, settle  # noqa: E402
from surrogate.flow.solution import Solution  # noqa: E402
from surrogate.flow.solver.newton import NewtonSettings  # noqa: E402
from surrogate.model.store import load, save  # noqa: E402
from surrogate.model.surrogate import Surrogate  # noqa: E402
from surrogate.scene.fidelity import FIDELITIES, Fidelity  # noqa: E402
from surrogate.scene.scene import Scene  # noqa: E402
from surrogate.scene.stream import Tunnel, Unbounded  # noqa: E402
from surrogate.training.train import train  # noqa: E402
from surrogate.versions import package_version  # noqa: E402

__version__ = package_version()
__all__ = [
    "FIDELITIES",
    "Family",
    "Fidelity",
    "Flow",
    "FlowBatch",
    "Forces",
    "InvalidInput",
    "LoadsAndGradients",
    "NewtonSettings",
    "NotConverged",
    "Particle",
    "Scene",
    "Settled",
    "Shape",
    "Solution",
    "Surrogate",
    "Tunnel",
    "Unbounded",
    "contour_shape",
    "export",
    "family_shape",
    "load",
    "naca4",
    "read_contour",
    "save",
    "settle",
    "train",
]


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
