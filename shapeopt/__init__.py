"""Shape optimisation with drag surrogates or with the flow solver, and the cost of training them.

This is the public API. ``shapeopt.render`` draws what it finds. Dependencies go one way:
problem -> search -> runs -> render; the payoff and the commands are above them. Particles fall by
a surrogate's loads: ``fall`` and ``orientations``.
"""

from shapeopt.free_fall import Fall, fall
from shapeopt.orientation import Orientation, Swing, moment_is_known, orientations, small_swings
from shapeopt.problem.constraints import Station
from shapeopt.problem.multipoint import MultiPoint
from shapeopt.problem.objective import AtReynolds, Glide, Objective, Weighted
from shapeopt.problem.particles import Settling, Tumbling
from shapeopt.problem.problem import Problem
from shapeopt.problem.robust import Robust
from shapeopt.problem.uncertainty import LogNormal, Uniform
from shapeopt.records import load_run
from shapeopt.runs import save_run
from shapeopt.search.design import Design
from shapeopt.search.designer import Designer
from shapeopt.search.evaluated import EvaluatedDesign
from shapeopt.search.optimise import optimise, optimise_all
from shapeopt.search.verify import Verified, verify

optimize = optimise  # the same function, spelled otherwise

__all__ = [
    "AtReynolds",
    "Design",
    "Designer",
    "EvaluatedDesign",
    "Fall",
    "Glide",
    "LogNormal",
    "MultiPoint",
    "Objective",
    "Orientation",
    "Problem",
    "Robust",
    "Settling",
    "Station",
    "Swing",
    "Tumbling",
    "Uniform",
    "Verified",
    "Weighted",
    "fall",
    "load_run",
    "moment_is_known",
    "optimise",
    "optimise_all",
    "optimize",
    "orientations",
    "save_run",
    "small_swings",
    "verify",
]


def __dir__() -> list[str]:
    return __all__
