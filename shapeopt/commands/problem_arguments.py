"""Options of optimisation problems: model, objective, constraints."""

import argparse

from shapeopt.commands.arguments import SURROGATES_HELP
from shapeopt.commands.cli import Parser
from shapeopt.commands.objective_arguments import add_objective_arguments, lifts_of, objective_of
from shapeopt.problem.constraints import Station
from shapeopt.problem.problem import Problem
from shapeopt.search.optimality import KKT_ACCEPTED, KKT_TOLERANCE
from surrogate.body.parameters import FAMILY
from surrogate.errors import InvalidInput
from surrogate.model.store import load
from surrogate.model.surrogate import Surrogate
from surrogate.scene.scene import Scene

UNTIL_HELP = (
    "surrogate: its own optimum (the default with one); flow: an optimum of the flow, sought to a "
    f"KKT residual of {KKT_TOLERANCE:g}, accepted up to {KKT_ACCEPTED:g}"
)
MEMORY_HELP = "JSON file of solved flows and adjoints, which later designs use and extend"


def add_problem_arguments(parser: Parser) -> None:
    """Add the options of an optimisation problem: model, objective and constraints."""
    add_model_arguments(parser)
    add_objective_arguments(parser)
    parser.add_argument("--max-length", type=float, help="bound on the chord in D (none)")
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
    lifts = lifts_of(arguments.lift)
    return Problem(
        surrogate.scene if surrogate else scene_of(arguments),
        objective_of(arguments, lifts),
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
