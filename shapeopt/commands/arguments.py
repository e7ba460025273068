"""Arguments that several commands share: bodies, scenes, problems."""

import argparse

from shapeopt.commands.cli import Parser, numbers
from shapeopt.problem.constraints import Station
from shapeopt.problem.objective import AtReynolds, Objective, Robust, Weighted
from shapeopt.problem.problem import Problem
from shapeopt.problem.uncertainty import LogNormal, Uniform
from surrogate.body.body_2d import Body2D
from surrogate.body.contour import naca4
from surrogate.body.contour_file import read_contour
from surrogate.body.parameters import PARAMETERS
from surrogate.body.shape import Shape, contour_shape, family_shape
from surrogate.errors import InvalidInput
from surrogate.model.store import load
from surrogate.model.surrogate import Surrogate
from surrogate.scene.limits import REYNOLDS, check_reynolds
from surrogate.scene.scene import Scene

REYNOLDS_HELP = "U D / nu, {:g} to {:g}, in space {:g} to {:g}".format(*REYNOLDS[2], *REYNOLDS[3])
UNCERTAINTIES = ("distribution", "spread", "tolerance", "cvar", "cases", "seed")


def reynolds_numbers(text: str, allow_unsteady: bool = False, dimension: int = 2) -> list[float]:
    """Reynolds numbers for which a steady laminar flow is a fair answer."""
    return [check_reynolds(value, allow_unsteady, dimension) for value in numbers(text)]


def add_family_arguments(parser: Parser) -> None:
    """--aspect, --flatness, --beta2, ..., --beta12."""
    for name, low, high, neutral, meaning, *_ in PARAMETERS.values():
        usual = f" ({neutral:g})" if name != "aspect" else ""
        help_ = f"{meaning}, {low:g} to {high:g}{usual}"
        parser.add_argument(f"--{name}", type=float, help=help_)


def family_named(arguments: argparse.Namespace) -> dict[str, float]:
    """The family's parameters by name: the usual ones, and what else was given."""
    given = {name: getattr(arguments, name) for name in PARAMETERS}
    return {
        n: value or 0.0
        for n, value in given.items()
        if n in Body2D.default_ranges or value is not None
    }


def add_body_arguments(parser: Parser) -> None:
    """A family body, a contour or a NACA section, at incidence."""
    add_family_arguments(parser)
    parser.add_argument("--contour", help="CSV of x,y, Selig or Lednicer .dat, scaled to area pi/4")
    parser.add_argument("--naca", help="NACA 4-digit section, as 0012")
    parser.add_argument(
        "--incidence", type=float, default=0.0, help="nose up in degrees, -180 to 180 (0)"
    )
    parser.add_argument("--keep-size", action="store_true", help="do not scale a contour")


def shape_of(arguments: argparse.Namespace, dimension: int = 2) -> Shape:
    """The body that was asked for."""
    given = [name for name in ("aspect", "contour", "naca") if getattr(arguments, name) is not None]
    if len(given) != 1:
        raise InvalidInput("body: give exactly one of --aspect, --contour and --naca")
    if arguments.aspect is not None:
        if arguments.keep_size:
            raise InvalidInput("--keep-size: goes with --contour or --naca")
        return family_shape(family_named(arguments), arguments.incidence, dimension)
    if dimension == 3:
        raise InvalidInput("--dimension 3: goes with --aspect; a contour is of the plane")
    if any(getattr(arguments, name) for name in PARAMETERS if name != "aspect"):
        raise InvalidInput("body: --flatness and --beta2 to --beta12 go with --aspect")
    if arguments.contour is None:
        return contour_shape(naca4(arguments.naca), arguments.incidence, arguments.keep_size)
    points = read_contour(arguments.contour)
    try:
        return contour_shape(points, arguments.incidence, arguments.keep_size)
    except InvalidInput as problem:
        raise InvalidInput(f"{arguments.contour}: {problem}") from None


def add_problem_arguments(parser: Parser) -> None:
    """Surrogate or scene, objective and constraints."""
    parser.add_argument(
        "--surrogate",
        default="pretrained",
        help="a folder, pretrained[:METHOD], or none (pretrained)",
    )
    parser.add_argument("--scene", help="TOML file, with --surrogate none")
    parser.add_argument(
        "--fidelity", help="draft, standard or fine, with --surrogate none (standard)"
    )
    parser.add_argument(
        "--reynolds", required=True, help=f"one, or several as 1,10,40: {REYNOLDS_HELP}"
    )
    parser.add_argument("--weights", help="of several Reynolds numbers, as 1,2,1 (equal)")
    parser.add_argument(
        "--spread", type=float, help="of Re: deviation of log Re, or half width over Re (0)"
    )
    parser.add_argument(
        "--distribution", choices=["lognormal", "uniform"], help="of Re (lognormal)"
    )
    parser.add_argument(
        "--tolerance",
        type=float,
        help="deviation of the shape parameters, in shares of their ranges (0)",
    )
    parser.add_argument(
        "--cvar", type=float, help="0.9: mean of the worst tenth of the cases (0: of all)"
    )
    parser.add_argument("--cases", type=int, help="drawn of the uncertainty, 2 to 4096 (32)")
    parser.add_argument("--seed", type=int, help="of the cases, from 0 (0)")
    parser.add_argument("--max-length", type=float, help="longest chord in D (no bound)")
    parser.add_argument(
        "--min-thickness", type=float, help="least greatest thickness in D (no bound)"
    )
    parser.add_argument(
        "--max-thickness", type=float, help="most of it, in space of the height, in D (no bound)"
    )
    parser.add_argument("--thickness-at", help="x/c:least thickness in D, as 0.25:0.5,0.75:0.3")
    parser.add_argument(
        "--min-radius", type=float, help="least radius of curvature in D (no bound)"
    )
    parser.add_argument("--range", help="of parameters, as aspect=1:3,beta2=-0.1:0.1")
    parser.add_argument(
        "--trust",
        type=float,
        default=0.0,
        help="share of each range to keep off its edges, below 0.5 (0)",
    )


def surrogate_of(arguments: argparse.Namespace) -> Surrogate | None:
    """The surrogate, or None where the flow itself is asked for."""
    surrogate = None if arguments.surrogate == "none" else load(arguments.surrogate)
    for name in ("fidelity", "scene"):
        if surrogate and getattr(arguments, name):
            raise InvalidInput(f"--{name}: belongs to --surrogate none; a surrogate has its own")
    return surrogate


def problem_of(arguments: argparse.Namespace, surrogate: Surrogate | None) -> Problem:
    """The problem that the arguments state."""
    return Problem(
        surrogate.scene if surrogate else scene_of(arguments),
        _objective(arguments),
        max_length=arguments.max_length,
        min_thickness=arguments.min_thickness,
        max_thickness=arguments.max_thickness,
        stations=_stations(arguments.thickness_at),
        min_radius=arguments.min_radius,
        within=_ranges(arguments.range),
        trust=arguments.trust,
    )


def scene_of(arguments: argparse.Namespace) -> Scene:
    """The scene of --scene or of --fidelity."""
    if not arguments.scene:
        return Scene(fidelity=arguments.fidelity or "standard")
    if arguments.fidelity:
        raise InvalidInput("--fidelity: is in the scene's file")
    return Scene.read(arguments.scene)


def _objective(arguments) -> Objective:
    reynolds = reynolds_numbers(arguments.reynolds, allow_unsteady=True)
    given = {name: getattr(arguments, name) for name in UNCERTAINTIES}
    uncertain = [name for name, value in given.items() if value is not None]
    if len(reynolds) > 1:
        if uncertain:
            raise InvalidInput(f"--{uncertain[0]}: belongs to one Reynolds number, not to several")
        weights = (1.0,) * len(reynolds)
        if arguments.weights is not None:
            weights = tuple(numbers(arguments.weights, "--weights", "1,2,1"))
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
        cases=32 if given["cases"] is None else given["cases"],
        seed=given["seed"] or 0,
    )


def _stations(text):
    try:
        pairs = [] if text is None else [word.split(":") for word in text.split(",")]
        return tuple(Station(float(x), float(thickness)) for x, thickness in pairs)
    except ValueError:
        raise InvalidInput(
            f"--thickness-at {text!r}: x/c:thickness, as 0.25:0.5,0.75:0.3"
        ) from None


def _ranges(text):
    if text is None:
        return None
    words, ranges = text.split(","), {}
    try:
        for word in words:
            name, values = word.split("=")
            low, high = map(float, values.split(":"))
            ranges[name.strip()] = (low, high)
    except ValueError:
        raise InvalidInput(f"--range {text!r}: as aspect=1:3,beta2=-0.1:0.1") from None
    if len(ranges) < len(words):
        raise InvalidInput(f"--range {text!r}: a parameter twice")
    return ranges
