"""Options of optimisation problems: model, objective, constraints."""

import argparse
from collections.abc import Sequence

from shapeopt.commands.arguments import REYNOLDS_HELP, SURROGATES_HELP
from shapeopt.commands.cli import Parser
from shapeopt.commands.particle import add_particle_argument, particle_of
from shapeopt.commands.ranges import numbers
from shapeopt.commands.reference import SEVERAL
from shapeopt.problem.constraints import Station
from shapeopt.problem.multipoint import MultiPoint
from shapeopt.problem.objective import AtReynolds, Glide, Objective, Weighted
from shapeopt.problem.particles import Settling, Tumbling
from shapeopt.problem.problem import Problem
from shapeopt.problem.robust import Robust
from shapeopt.problem.uncertainty import LogNormal, Uniform
from shapeopt.search.optimality import KKT_ACCEPTED, KKT_TOLERANCE
from surrogate.body.parameters import FAMILY
from surrogate.errors import InvalidInput
from surrogate.model.store import load
from surrogate.model.surrogate import Surrogate
from surrogate.scene.scene import Scene

GLIDE = "glide"  # the objective at one Reynolds number, which may be uncertain
SINGLE = {GLIDE: Glide, "tumbling": Tumbling}  # objectives at one Reynolds number
SETTLING = "settling"  # the objective that finds its Reynolds number
UNTIL_HELP = (
    "end at the surrogate's optimum (default, where there is one), or at the flow's, where the KKT "
    f"residual, with the violation of bounds on loads, is {KKT_TOLERANCE:g}, or at most "
    f"{KKT_ACCEPTED:g}"
)
CHORD_HELP = (
    "chord Reynolds number U c / nu instead of --reynolds: optimise at fixed chord c, with the "
    "area free (2-D, one number, no tunnel). Unlike in solve_drag.py, Cd, Cl and Cm are then over "
    "c (Cm: c^2) and lengths of bounds in c: --min-thickness 0.3 is t/c, without which the "
    "thinnest body of the family mostly wins"
)
MEMORY_HELP = "JSON file of solved flows and adjoints, which later designs use and extend"
UNCERTAINTIES = ("distribution", "spread", "tolerance", "cvar", "cases", "seed")


def add_problem_arguments(parser: Parser) -> None:
    """Add the options of an optimisation problem: model, objective and constraints."""
    add_model_arguments(parser)
    add = parser.add_argument
    add("--reynolds", help=f"{SEVERAL}: {REYNOLDS_HELP}")
    add("--chord-reynolds", help=f"without --spread or several lifts: {CHORD_HELP}")
    objective = "drag: least Cd (default); glide: greatest Cl / Cd, also under --spread; tumbling: "
    objective += "least mean Cd over all orientations of a body of revolution; settling: greatest "
    objective += "terminal velocity of a particle of --archimedes, held at its incidence"
    add("--objective", choices=["drag", *SINGLE, SETTLING], default="drag", help=objective)
    add("--archimedes", type=float, help="number |density ratio - 1| g D^3 / nu^2, for settling")
    add_particle_argument(parser, "for settling, in place of --archimedes: ")
    lifts = "lower bound on Cl; several, as 0.2,0.5,0.8: least mean Cd of one section over them, "
    lifts += "each at an incidence of its own, for --objective drag by D (none); "
    lifts += "design_sheet.py --lifts finds a section for each"
    add("--lift", help=lifts)
    add("--weights", help="weight of each Reynolds number or lift, as 1,2,1 (equal)")
    spread = "standard deviation of log Re; of the uniform distribution half its width over Re (0)"
    add("--spread", type=float, help=spread)
    add("--distribution", choices=["lognormal", "uniform"], help="distribution of Re (lognormal)")
    tolerance = "standard deviation of each parameter over its range's width, truncated at 2 (0)"
    add("--tolerance", type=float, help=tolerance)
    add("--cvar", type=float, help="CVaR level; 0.9: mean over the worst tenth of cases (0: all)")
    add("--cases", type=int, help="samples of the uncertainty, 2 to 4096 (32)")
    add("--seed", type=int, help="seed of the samples, from 0 (0)")
    add("--max-length", type=float, help="bound on the chord in D (none)")
    add_constraint_arguments(parser)


def add_model_arguments(parser: Parser) -> None:
    """Add the options of the model of a search: a surrogate, or the flow of a scene."""
    add = parser.add_argument
    models = f"folder, pretrained[:NAME] (default) or none; {SURROGATES_HELP}"
    add("--surrogate", default="pretrained", help=models)
    add("--scene", help="TOML file, with --surrogate none")
    add("--fidelity", help="draft, standard or fine, with --surrogate none (standard)")


def add_search_arguments(parser: Parser) -> None:
    """Add the options --until and --memory: where a search ends, and which flows it knows."""
    parser.add_argument("--until", choices=["surrogate", "flow"], help=UNTIL_HELP)
    parser.add_argument("--memory", help=MEMORY_HELP)


def add_constraint_arguments(parser: Parser) -> None:
    """Add the options of constraints other than on length and lift."""
    add = parser.add_argument
    moment = "lower bound on Cm about the centroid, nose up (none)"
    add("--min-moment", type=float, help=moment)
    add("--max-moment", type=float, help="upper bound on Cm (none)")
    add("--min-thickness", type=float, help="lower bound on the greatest thickness in D (c) (none)")
    add(
        "--max-thickness",
        type=float,
        help="upper bound on the thickness, 3-D: height, in D (c) (none)",
    )
    add("--max-camber", type=float, help="upper bound on the camber in D (c), 2-D (none)")
    add("--thickness-at", help="x/c:minimum thickness in D (c), as 0.25:0.5,0.75:0.3")
    add("--min-radius", type=float, help="lower bound on the radius of curvature in D (c) (none)")
    family = parser.add_argument_group("bodies of the family", FAMILY)
    family.add_argument("--range", help="ranges of parameters, as aspect=1:3,beta2=-0.1:0.1")
    add(
        "--trust", type=float, default=0.0, help="margin at the ends of each range, < 0.5 of it (0)"
    )


def surrogate_of(arguments: argparse.Namespace) -> Surrogate | None:
    """Return the surrogate that the options name, or None for ``--surrogate none``.

    Raises:
      InvalidInput: --fidelity or --scene is given with a surrogate, which has its own.
    """
    surrogate = None if arguments.surrogate == "none" else load(arguments.surrogate)
    for name in ("fidelity", "scene"):
        if surrogate and getattr(arguments, name):
            raise InvalidInput(f"--{name}: belongs to --surrogate none; a surrogate has its own")
    return surrogate


def ends_on_flow(arguments: argparse.Namespace, surrogate: Surrogate | None) -> bool:
    """Return whether the search ends at the flow's optimum, by --until and the model.

    Raises:
      InvalidInput: the flow alone is to be searched until the surrogate's optimum, or flows are to
        be kept where none are solved.
    """
    if surrogate is None and arguments.until == "surrogate":
        raise InvalidInput(
            "--until surrogate: needs a surrogate; --surrogate none optimises on the flow"
        )
    on_flow = surrogate is None or arguments.until == "flow"
    if arguments.memory is not None and not on_flow:
        raise InvalidInput("--memory: goes with --until flow or --surrogate none")
    return on_flow


def problem_of(arguments: argparse.Namespace, surrogate: Surrogate | None) -> Problem:
    """Return the optimisation problem that the options describe."""
    lifts = _lifts(arguments.lift)
    return Problem(
        surrogate.scene if surrogate else scene_of(arguments),
        _objective(arguments, lifts),
        max_length=arguments.max_length,
        lift=lifts[0] if len(lifts) == 1 else None,
        by_chord=arguments.chord_reynolds is not None,
        **constraints_of(arguments),
    )


def constraints_of(arguments: argparse.Namespace) -> dict[str, object]:
    """Return the constraints other than on length and lift, by their names in ``Problem``."""
    return {
        "min_moment": arguments.min_moment,
        "max_moment": arguments.max_moment,
        "min_thickness": arguments.min_thickness,
        "max_thickness": arguments.max_thickness,
        "max_camber": arguments.max_camber,
        "stations": _stations(arguments.thickness_at),
        "min_radius": arguments.min_radius,
        "within": _ranges(arguments.range),
        "trust": arguments.trust,
    }


def scene_of(arguments: argparse.Namespace) -> Scene:
    """Return the scene of the file --scene, or the default scene with the fidelity --fidelity.

    Raises:
      InvalidInput: both options are given.
    """
    if not arguments.scene:
        return Scene(fidelity=arguments.fidelity or "standard")
    if arguments.fidelity:
        raise InvalidInput("--fidelity: is in the scene's file")
    return Scene.read(arguments.scene)


def _objective(arguments: argparse.Namespace, lifts: Sequence[float]) -> Objective:
    if arguments.reynolds is not None and arguments.chord_reynolds is not None:
        raise InvalidInput("--reynolds, --chord-reynolds: give one of them, not both")
    given = {name: getattr(arguments, name) for name in UNCERTAINTIES}
    without = {"spread": 0.0, "tolerance": 0.0}  # as if the option were not given
    uncertain = [n for n, value in given.items() if value not in (None, without.get(n))]
    settles, archimedes = arguments.objective == SETTLING, _archimedes(arguments)
    if settles != (archimedes is not None):
        raise InvalidInput(
            "--archimedes, --particle: one of them goes with --objective settling, which needs it"
        )
    if len(lifts) > 1:
        return _multipoint(arguments, lifts, uncertain)
    if settles:
        others = ("reynolds", "chord_reynolds", "weights")
        others = [name for name in others if getattr(arguments, name) is not None]
        if others or uncertain:
            name = [*others, *uncertain][0].replace("_", "-")
            raise InvalidInput(
                f"--{name}: does not go with --objective {SETTLING}, which finds its Reynolds "
                "number itself"
            )
        return Settling(archimedes)
    if arguments.chord_reynolds is not None:
        reynolds = numbers(arguments.chord_reynolds, "--chord-reynolds")
    elif arguments.reynolds is not None:
        reynolds = numbers(arguments.reynolds)
    else:
        others = "or --chord-reynolds; only --objective settling finds its own"
        raise InvalidInput(f"--reynolds: give it, {others}")
    glides = arguments.objective == GLIDE
    if arguments.objective in SINGLE and arguments.weights is not None:
        words = f"does not go with --objective {arguments.objective}"
        raise InvalidInput(f"--weights: {words}, which takes one Reynolds number")
    if arguments.objective in SINGLE and not (glides and uncertain):
        if len(reynolds) > 1 or uncertain:
            words = "goes with one Reynolds number" + ", without spread" * (not glides)
            raise InvalidInput(f"--objective {arguments.objective}: {words}")
        return SINGLE[arguments.objective](reynolds[0])
    if len(reynolds) > 1:
        if uncertain:
            raise InvalidInput(f"--{uncertain[0]}: belongs to one Reynolds number, not to several")
        return Weighted(tuple(reynolds), _weights(arguments) or (1.0,) * len(reynolds))
    if arguments.weights:
        raise InvalidInput(
            "--weights: belongs to several Reynolds numbers or lifts, as --reynolds 1,10,40"
        )
    if not uncertain:
        return AtReynolds(reynolds[0])
    if not (given["spread"] or given["tolerance"]):
        raise InvalidInput(f"--{uncertain[0]}: needs an uncertainty, --spread or --tolerance")
    if given["distribution"] and not given["spread"]:
        raise InvalidInput("--distribution: goes with --spread, the spread of Re")
    kind = Uniform if given["distribution"] == "uniform" else LogNormal
    return Robust(
        reynolds[0],
        kind(given["spread"] or 0.0),
        tolerance=given["tolerance"] or 0.0,
        level=given["cvar"] or 0.0,
        cases=32 if given["cases"] is None else given["cases"],
        seed=given["seed"] or 0,
        glide=glides,
    )


def _archimedes(arguments: argparse.Namespace) -> float | None:
    """Return the Archimedes number of --archimedes or --particle; None where neither is given."""
    if arguments.particle is None:
        return arguments.archimedes
    if arguments.archimedes is not None:
        raise InvalidInput("--archimedes, --particle: give one of them, not both")
    return particle_of(arguments.particle).archimedes


def _lifts(text: str | None) -> list[float]:
    if text is None:
        return []
    return numbers(text, "--lift", "0.2,0.5,0.8", "0.2:0.8:4", logarithmic=False)


def _multipoint(
    arguments: argparse.Namespace, lifts: Sequence[float], uncertain: Sequence[str]
) -> MultiPoint:
    """Return the objective over several lifts, at one Reynolds number without uncertainty."""
    reynolds = [] if arguments.reynolds is None else numbers(arguments.reynolds)
    if arguments.objective != "drag" or len(reynolds) != 1 or uncertain:
        raise InvalidInput(
            "--lift: several go with --objective drag and one --reynolds, without spread"
        )
    return MultiPoint(reynolds[0], tuple(lifts), _weights(arguments))


def _weights(arguments: argparse.Namespace) -> tuple[float, ...] | None:
    if arguments.weights is None:
        return None
    return tuple(numbers(arguments.weights, "--weights", "1,2,1"))


def _stations(text: str | None) -> tuple[Station, ...]:
    try:
        pairs = [] if text is None else [word.split(":") for word in text.split(",")]
        return tuple(Station(float(x), float(thickness)) for x, thickness in pairs)
    except ValueError:
        example = "x/c:thickness, as 0.25:0.5,0.75:0.3"
        raise InvalidInput(f"--thickness-at {text!r}: {example}") from None


def _ranges(text: str | None) -> dict[str, tuple[float, float]] | None:
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
        raise InvalidInput(f"--range {text!r}: a parameter is given twice")
    return ranges
