"""The arguments that state a shape optimisation problem."""

import argparse

from common import fidelity_of, numbers, reynolds_numbers

from shapeopt.problem.constraints import Station
from shapeopt.problem.objective import AtReynolds, Objective, Robust, Weighted
from shapeopt.problem.problem import Problem
from shapeopt.problem.uncertainty import LogNormal, Uniform
from surrogate.body.family import PARAMETERS, Family
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene
from surrogate.model.store import Surrogate, load_surrogate

UNCERTAINTIES = ("distribution", "spread", "tolerance", "cvar", "cases", "seed")


def add_problem_arguments(parser: argparse.ArgumentParser) -> None:
    """Surrogate, objective and constraints."""
    parser.add_argument("--surrogate", default="pretrained", help="a folder, pretrained, or none")
    parser.add_argument("--fidelity", help="draft, standard or fine, with --surrogate none")
    parser.add_argument("--reynolds", required=True, help="U D / nu; several as 1,10,40")
    parser.add_argument("--weights", help="of several Reynolds numbers, as 1,2,1")
    parser.add_argument("--spread", type=float, help="of Re: deviation of log Re, or half width")
    parser.add_argument("--distribution", choices=["lognormal", "uniform"], help="of Re")
    parser.add_argument(
        "--tolerance", type=float, help="deviation of the shape parameters, over their ranges"
    )
    parser.add_argument("--cvar", type=float, help="0.9: the mean of the worst tenth of the cases")
    parser.add_argument("--cases", type=int, help="samples of the uncertainty (32)")
    parser.add_argument("--seed", type=int, help="of the samples (0)")
    parser.add_argument("--max-length", type=float, help="longest chord, in D")
    parser.add_argument("--min-thickness", type=float, help="least greatest thickness, in D")
    parser.add_argument("--thickness-at", help="x/c:least thickness in D, as 0.25:0.5,0.75:0.3")
    parser.add_argument("--min-radius", type=float, help="least radius of curvature, in D")
    parser.add_argument("--range", help="of parameters, as aspect=1:3,beta2=-0.1:0.1")
    parser.add_argument(
        "--trust", type=float, default=0.0, help="share of each trained range to keep off its edges"
    )


def surrogate_of(arguments: argparse.Namespace) -> Surrogate | None:
    """The surrogate, or None where the flow itself is asked for."""
    surrogate = None if arguments.surrogate == "none" else load_surrogate(arguments.surrogate)
    if surrogate and arguments.fidelity:
        raise InvalidInput("--fidelity: belongs to --surrogate none; a surrogate has its scene's")
    return surrogate


def problem_of(arguments: argparse.Namespace, surrogate: Surrogate | None) -> Problem:
    """The problem that the arguments state."""
    fidelity = fidelity_of(arguments.fidelity or "standard")
    scene = surrogate.scene if surrogate else Scene(fidelity=fidelity)
    return Problem(
        scene,
        _objective(arguments),
        max_length=arguments.max_length,
        min_thickness=arguments.min_thickness,
        stations=_stations(arguments.thickness_at),
        min_radius=arguments.min_radius,
        within=_family(arguments.range, scene.family),
        trust=arguments.trust,
    )


def _objective(arguments) -> Objective:
    reynolds = reynolds_numbers(arguments.reynolds)
    given = {name: getattr(arguments, name) for name in UNCERTAINTIES}
    uncertain = [name for name, value in given.items() if value is not None]
    if len(reynolds) > 1:
        if uncertain:
            raise InvalidInput(f"--{uncertain[0]}: belongs to one Reynolds number, not to several")
        weights = _weights(arguments.weights) if arguments.weights else (1.0,) * len(reynolds)
        return Weighted(tuple(reynolds), weights)
    if arguments.weights:
        raise InvalidInput("--weights: belongs to several Reynolds numbers, as --reynolds 1,10,40")
    if not uncertain:
        return AtReynolds(reynolds[0])
    if not (given["spread"] or given["tolerance"]):
        raise InvalidInput(f"--{uncertain[0]}: needs an uncertainty, --spread or --tolerance")
    kind = Uniform if given["distribution"] == "uniform" else LogNormal
    return Robust(
        reynolds[0],
        kind(given["spread"] or 0.0),
        tolerance=given["tolerance"] or 0.0,
        level=given["cvar"] or 0.0,
        samples=32 if given["cases"] is None else given["cases"],
        seed=given["seed"] or 0,
    )


def _weights(text):
    try:
        return tuple(numbers(text))
    except InvalidInput:
        raise InvalidInput(f"--weights {text!r}: numbers with commas, as 1,2,1") from None


def _stations(text):
    try:
        pairs = [word.split(":") for word in (text or "").split(",") if word]
        return tuple(Station(float(x), float(thickness)) for x, thickness in pairs)
    except ValueError:
        raise InvalidInput(
            f"--thickness-at {text!r}: x/c:thickness, as 0.25:0.5,0.75:0.3"
        ) from None


def _family(text, family):
    if text is None:
        return None
    bounds = {name: getattr(family, name) for name in PARAMETERS}
    try:
        for word in text.split(","):
            name, values = word.split("=")
            low, high = map(float, values.split(":"))
            if name not in bounds:
                raise ValueError
            bounds[name] = (low, high)
    except ValueError:
        raise InvalidInput(
            f"--range {text!r}: of {', '.join(PARAMETERS)}, as aspect=1:3,beta2=-0.1:0.1"
        ) from None
    return Family(**bounds)
