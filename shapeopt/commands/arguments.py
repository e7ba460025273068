"""Options of bodies, which several commands share."""

import argparse
import functools
import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from shapeopt.commands.cli import Parser
from shapeopt.commands.ranges import numbers
from surrogate.body.body_2d import Body2D
from surrogate.body.contour import naca4
from surrogate.body.contour_file import read_contour
from surrogate.body.incidence import check_incidence
from surrogate.body.parameters import FAMILY, INCIDENCE, PARAMETERS
from surrogate.body.shape import Shape, contour_shape, family_shape
from surrogate.errors import InvalidInput, TooLarge
from surrogate.files import JsonObject, file_digest
from surrogate.scene.fidelity import MOST_CELLS
from surrogate.scene.limits import REYNOLDS

SURROGATES_HELP = (
    "NAME: lift (sections at incidence), space (3-D) or particle (3-D at any incidence); or a "
    "method: dp (differentiable physics), sip (scale-invariant physics), hig (half-inverse "
    "gradients) or supervised (regression)"
)
SINGLE_VALUED = tuple(name for name in PARAMETERS if name != INCIDENCE.name)  # one value each
REYNOLDS_HELP = "U D / nu, {:g} to {:g}, in 3-D {:g} to {:g}".format(*REYNOLDS[2], *REYNOLDS[3])


def add_family_arguments(parser: Parser, names: Iterable[str]) -> None:
    """Add an option for every named parameter of a family body, --aspect to --incidence."""
    group = parser.add_argument_group("body of the family", FAMILY)
    for p in map(PARAMETERS.__getitem__, names):
        usual = f" ({p.neutral:g})" if p.name != "aspect" else ""
        words = f"{p.meaning}, {p.low:g} to {p.high:g}{usual}"
        group.add_argument(f"--{p.name}", type=float, help=words)


def add_surrogate_argument(parser: Parser) -> None:
    """Add the option --surrogate, of a trained one."""
    models = f"folder, or pretrained[:NAME] (pretrained); {SURROGATES_HELP}"
    parser.add_argument("--surrogate", default="pretrained", help=models)


def check_aspect(arguments: argparse.Namespace) -> None:
    """Raise InvalidInput unless the option --aspect, which bodies of a family need, is given."""
    if arguments.aspect is None:
        raise InvalidInput("body: --aspect is needed")


def family_named(arguments: argparse.Namespace, names: Iterable[str]) -> dict[str, float]:
    """Return a body's parameters by name, as the options give them.

    Those of the default 2-D family are always there, 0 where no option gives them; others only if
    given.
    """
    given = {name: getattr(arguments, name) for name in names}
    usual = Body2D.default_ranges
    return {n: value or 0.0 for n, value in given.items() if n in usual or value is not None}


def add_body_arguments(parser: Parser, several: bool = True) -> None:
    """Add the options of a body: of the family, a contour or a NACA section, at incidence.

    Args:
      parser: of the command.
      several: whether the command takes several incidences.
    """
    add_family_arguments(parser, SINGLE_VALUED)
    add = parser.add_argument
    add(
        "--contour",
        help="CSV of x,y, Selig or Lednicer .dat; the stream is along +x, the area scaled to pi/4",
    )
    add("--naca", help="NACA 4-digit section, as 0012")
    add_incidence_argument(parser, several)
    add(
        "--keep-size",
        action="store_true",
        help="points are in D already: not scaled to the area pi/4",
    )


def add_incidence_argument(parser: Parser, several: bool = True) -> None:
    """Add the option --incidence, of one or several angles."""
    angles = "one, several as -4,0,4, or FIRST:LAST:COUNT" if several else "one angle"
    parser.add_argument("--incidence", help=f"nose up in degrees, -180 to 180: {angles} (0)")


def incidences_of(arguments: argparse.Namespace) -> list[float]:
    """Return the incidences that the option gives, in degrees; 0 without it.

    Raises:
      InvalidInput: it gives none.
    """
    given = "0" if arguments.incidence is None else arguments.incidence
    return numbers(given, "--incidence", "-4,0,4", "-4:12:9", logarithmic=False)


def shapes_of(arguments: argparse.Namespace, dimension: int = 2) -> dict[float, Shape]:
    """Return the bodies that the options describe, one for each incidence in degrees.

    Raises:
      InvalidInput: there is none, or options contradict each other.
    """
    return {angle: _shape(arguments, angle, dimension) for angle in incidences_of(arguments)}


def shape_of(arguments: argparse.Namespace, dimension: int = 2) -> Shape:
    """Return the body that the options describe, at its one incidence.

    Raises:
      InvalidInput: as ``shapes_of``, or there are several incidences.
    """
    shapes = list(shapes_of(arguments, dimension).values())
    if len(shapes) > 1:
        raise InvalidInput("--incidence: one angle; run once for each")
    return shapes[0]


def body_record(arguments: argparse.Namespace) -> JsonObject:
    """Return what the options say of a body, its incidence apart, for the results."""
    if arguments.naca is not None:
        return {"naca": arguments.naca, "keep_size": arguments.keep_size}
    if arguments.contour is not None:
        return {"contour": arguments.contour, "keep_size": arguments.keep_size}
    return {"parameters": family_named(arguments, SINGLE_VALUED)}


def body_settings(arguments: argparse.Namespace) -> JsonObject:
    """Return ``body_record``, and of a contour the digest of its file, to know a body again."""
    given = body_record(arguments)
    return given | {"sha256": file_digest(Path(arguments.contour))} if arguments.contour else given


@contextmanager
def refusals_by_options(
    keep_size: bool, prefix: str = "", refinement: float = 1.0
) -> Iterator[None]:
    """Rewrite a grid's error about a body so that it names the options that would help.

    The library's messages say how many cells per D would do, which is ``--cells`` here; where
    ``--keep-size`` is the cause, it is named.

    Args:
      keep_size: whether that option is given.
      prefix: is put before the message.
      refinement: cells of the flow over those of ``--cells``, for thin boundary layers.
    """
    try:
        yield
    except InvalidInput as error:
        named = functools.partial(_name_cells, refinement)
        message = re.sub(r"(\d+) cells per D", named, str(error))
        if keep_size and isinstance(error, TooLarge):
            message += "; without --keep-size it is"
        raise InvalidInput(f"{prefix}{message}") from None


def _name_cells(refinement: float, cells: re.Match[str]) -> str:
    """Return the option for a number of cells per D, or that the option does not take it."""
    if int(cells[1]) <= MOST_CELLS:
        return f"--cells {math.ceil(int(cells[1]) / refinement)}"
    return f"{cells[0]}, more than --cells takes ({MOST_CELLS}),"


def _shape(arguments: argparse.Namespace, incidence: float, dimension: int) -> Shape:
    given = [name for name in ("aspect", "contour", "naca") if getattr(arguments, name) is not None]
    if len(given) != 1:
        raise InvalidInput("body: give exactly one of --aspect, --contour and --naca")
    if arguments.aspect is not None:
        if arguments.keep_size:
            raise InvalidInput("--keep-size: goes with --contour or --naca")
        named = family_named(arguments, SINGLE_VALUED)
        if arguments.incidence is not None:  # also 0, as gradients are by it too then
            named[INCIDENCE.name] = check_incidence(incidence)
        return family_shape(named, dimension=dimension)
    if dimension == 3:
        raise InvalidInput("--dimension 3: goes with --aspect; a contour is 2-D")
    if any(getattr(arguments, name) for name in SINGLE_VALUED if name != "aspect"):
        modes = "--gamma2 to --gamma6 and --beta2 to --beta12"
        raise InvalidInput(f"body: --flatness, {modes} go with --aspect")
    if arguments.contour is None:
        return contour_shape(naca4(arguments.naca), incidence, arguments.keep_size)
    points = read_contour(arguments.contour)
    try:
        return contour_shape(points, incidence, arguments.keep_size)
    except InvalidInput as error:
        raise InvalidInput(f"{arguments.contour}: {error}") from None
