"""Options of the objective of an optimisation problem: what is minimised, and at which Re."""

import argparse
from collections.abc import Sequence

from shapeopt.commands.arguments import REYNOLDS_HELP
from shapeopt.commands.cli import Parser
from shapeopt.commands.particle import add_particle_argument, particle_of
from shapeopt.commands.ranges import numbers
from shapeopt.commands.reference import SEVERAL
from shapeopt.problem.multipoint import MultiPoint
from shapeopt.problem.objective import AtReynolds, Glide, Objective, Weighted
from shapeopt.problem.particles import Settling, Tumbling
from shapeopt.problem.robust import Robust
from shapeopt.problem.uncertainty import LogNormal, Uniform
from surrogate.errors import InvalidInput

GLIDE = "glide"  # the objective at one Reynolds number, which may be uncertain
SINGLE = {GLIDE: Glide, "tumbling": Tumbling}  # objectives at one Reynolds number
SETTLING = "settling"  # the objective that finds its Reynolds number
CHORD_HELP = (
    "chord Reynolds number U c / nu instead of --reynolds: optimise at fixed chord c, with the "
    "area free (2-D, one number, no tunnel). Unlike in solve_drag.py, Cd, Cl and Cm are then over "
    "c (Cm: c^2) and lengths of bounds in c: --min-thickness 0.3 is t/c, without which the "
    "thinnest body of the family mostly wins"
)
UNCERTAINTIES = ("distribution", "spread", "tolerance", "cvar", "cases", "seed")
NO_UNCERTAINTY = {"spread": 0.0, "tolerance": 0.0}  # as if the option were not given


def add_objective_arguments(parser: Parser) -> None:
    """Add the options of the objective, its Reynolds numbers and lifts, and their uncertainty."""
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


def objective_of(arguments: argparse.Namespace, lifts: Sequence[float]) -> Objective:
    """Return the objective that the options describe.

    Args:
      arguments: the options.
      lifts: the lower bounds on Cl, of ``lifts_of``.

    Raises:
      InvalidInput: options do not go together, or one that is needed is missing.
    """
    if arguments.reynolds is not None and arguments.chord_reynolds is not None:
        raise InvalidInput("--reynolds, --chord-reynolds: give one of them, not both")
    uncertain = _uncertainties(arguments)
    archimedes = _archimedes(arguments)
    if len(lifts) > 1:
        return _multipoint(arguments, lifts, uncertain)
    if archimedes is not None:
        return _settling(arguments, archimedes, uncertain)
    reynolds, glides = _reynolds(arguments), arguments.objective == GLIDE
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
    return _robust(arguments, reynolds[0], uncertain) if uncertain else AtReynolds(reynolds[0])


def lifts_of(text: str | None) -> list[float]:
    """Return the lower bounds on Cl that the option --lift gives; none without it."""
    if text is None:
        return []
    return numbers(text, "--lift", "0.2,0.5,0.8", "0.2:0.8:4", logarithmic=False)


def _uncertainties(arguments: argparse.Namespace) -> list[str]:
    """Return the names of the options of uncertainty that are given."""
    given = {name: getattr(arguments, name) for name in UNCERTAINTIES}
    return [name for name, x in given.items() if x not in (None, NO_UNCERTAINTY.get(name))]


def _archimedes(arguments: argparse.Namespace) -> float | None:
    """Return the Archimedes number of --archimedes or --particle; None without settling."""
    if arguments.particle is None:
        number = arguments.archimedes
    elif arguments.archimedes is not None:
        raise InvalidInput("--archimedes, --particle: give one of them, not both")
    else:
        number = particle_of(arguments.particle).archimedes
    if (arguments.objective == SETTLING) != (number is not None):
        raise InvalidInput(
            "--archimedes, --particle: one of them goes with --objective settling, which needs it"
        )
    return number


def _reynolds(arguments: argparse.Namespace) -> list[float]:
    """Return the Reynolds numbers of --reynolds or --chord-reynolds, one of which is needed."""
    if arguments.chord_reynolds is not None:
        return numbers(arguments.chord_reynolds, "--chord-reynolds")
    if arguments.reynolds is not None:
        return numbers(arguments.reynolds)
    others = "or --chord-reynolds; only --objective settling finds its own"
    raise InvalidInput(f"--reynolds: give it, {others}")


def _settling(
    arguments: argparse.Namespace, archimedes: float, uncertain: Sequence[str]
) -> Settling:
    """Return the objective of a settling particle, which takes no Reynolds number."""
    others = ("reynolds", "chord_reynolds", "weights")
    others = [name for name in others if getattr(arguments, name) is not None]
    if others or uncertain:
        name = [*others, *uncertain][0].replace("_", "-")
        raise InvalidInput(
            f"--{name}: does not go with --objective {SETTLING}, which finds its Reynolds "
            "number itself"
        )
    return Settling(archimedes)


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


def _robust(arguments: argparse.Namespace, reynolds: float, uncertain: Sequence[str]) -> Robust:
    """Return the objective over an uncertain Reynolds number, an uncertain shape, or both."""
    if not (arguments.spread or arguments.tolerance):
        raise InvalidInput(f"--{uncertain[0]}: needs an uncertainty, --spread or --tolerance")
    if arguments.distribution and not arguments.spread:
        raise InvalidInput("--distribution: goes with --spread, the spread of Re")
    kind = Uniform if arguments.distribution == "uniform" else LogNormal
    return Robust(
        reynolds,
        kind(arguments.spread or 0.0),
        tolerance=arguments.tolerance or 0.0,
        level=arguments.cvar or 0.0,
        cases=32 if arguments.cases is None else arguments.cases,
        seed=arguments.seed or 0,
        glide=arguments.objective == GLIDE,
    )


def _weights(arguments: argparse.Namespace) -> tuple[float, ...] | None:
    """Return the weights of --weights; None without it."""
    if arguments.weights is None:
        return None
    return tuple(numbers(arguments.weights, "--weights", "1,2,1"))
