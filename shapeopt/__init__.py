"""Shape optimisation by drag surrogates or by the flow, and the measurement of what pays.

The front door; ``shapeopt.render`` draws what it finds: problem -> search -> runs -> render. Rooms
open when they are first asked for, so that a command has begun before libraries are loaded.
"""

import importlib
import importlib.util
from typing import Any

ROOMS = {
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
__all__ = list(ROOMS)


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    if name in ROOMS:
        return getattr(importlib.import_module(f"{__name__}.{ROOMS[name]}"), name)
    if importlib.util.find_spec(f"{__name__}.{name}") is not None:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
