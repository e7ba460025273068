"""Shape optimisation by drag surrogates or by the flow, and the measurement of what pays.

The front door; ``shapeopt.render`` draws what it finds: problem -> search -> runs -> render.
"""

from shapeopt.problem.constraints import Station
from shapeopt.problem.objective import Robust, Weighted
from shapeopt.problem.problem import Problem
from shapeopt.problem.uncertainty import LogNormal, Uniform
from shapeopt.runs import load_run, save_run
from shapeopt.search.design import Design
from shapeopt.search.designer import Designer
from shapeopt.search.optimise import optimise, optimise_all
from shapeopt.search.verify import Verified, verify

__all__ = [
    "Design",
    "Designer",
    "LogNormal",
    "Problem",
    "Robust",
    "Station",
    "Uniform",
    "Verified",
    "Weighted",
    "load_run",
    "optimise",
    "optimise_all",
    "save_run",
    "verify",
]


def __dir__() -> list[str]:
    return __all__
