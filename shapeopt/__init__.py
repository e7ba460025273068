"""Shape optimisation with drag surrogates or with the flow itself, and when training pays.

Public API of the package; the mathematics is in ``shapeopt/README.md``. Modules are imported when
one of their names is first used, so that commands start before JAX and the solver are loaded.
"""

import importlib
import importlib.util
from typing import Any

LAZY_EXPORTS = {  # public name: module that defines it
    "Design": "search.design",
    "Designer": "search.designer",
    "LogNormal": "problem.uncertainty",
    "Problem": "problem.problem",
    "Robust": "problem.objective",
    "Station": "problem.constraints",
    "Uniform": "problem.uncertainty",
    "Verified": "search.verify",
    "Weighted": "problem.objective",
    "load_run": "runs",
    "optimise": "search.optimise",
    "optimise_all": "search.optimise",
    "save_run": "runs",
    "verify": "search.verify",
}
__all__ = list(LAZY_EXPORTS)


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    if name in LAZY_EXPORTS:
        return getattr(importlib.import_module(f"{__name__}.{LAZY_EXPORTS[name]}"), name)
    if importlib.util.find_spec(f"{__name__}.{name}") is not None:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
