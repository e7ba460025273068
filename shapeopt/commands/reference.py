"""Reynolds numbers and coefficients by the chord c, beside those by the equivalent diameter D."""

import argparse

from shapeopt.commands.arguments import REYNOLDS_HELP
from shapeopt.commands.cli import Parser
from shapeopt.commands.newtons import conditions_of
from shapeopt.commands.ranges import numbers
from surrogate.body.chord_line import (
    CHORD,
    DIAMETER,
    FORCE_POWER,
    MOMENT_POWER,
    centroid_station,
    chord_point,
    moment_about,
)
from surrogate.body.shape import Shape
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject
from surrogate.scene.limits import check_reynolds

SEVERAL = "one, several as 1,10,40, or a range as 1:40:20 or 1:40:log20"
OF_FORCES = "cd", "cd_extrapolated", "cd_pressure", "cd_friction", "cl", "estimated_lift_error"
OF_MOMENTS = "cm", "cm_about", "estimated_moment_error"  # keys of a row, as those of forces
KEY_POWERS = dict.fromkeys(OF_FORCES, FORCE_POWER) | dict.fromkeys(OF_MOMENTS, MOMENT_POWER)


def add_reynolds_arguments(parser: Parser, several: bool = True) -> None:
    """Add the options --reynolds and --chord-reynolds, of which at most one is to be given.

    Args:
      parser: of the command.
      several: whether the command takes several Reynolds numbers.
    """
    forms, same = (SEVERAL, "; in the same forms") if several else ("one number", "")
    parser.add_argument("--reynolds", help=f"{forms}: {REYNOLDS_HELP}")
    parser.add_argument("--chord-reynolds", help=f"U c / nu instead, c the chord{same}")


def add_reference_argument(parser: Parser) -> None:
    """Add the options of coefficients: --reference, their length, and --moment-about."""
    reference = "length of the coefficients: diameter (D, the default) or chord (Cm: its square)"
    parser.add_argument("--reference", choices=(DIAMETER, CHORD), default=DIAMETER, help=reference)
    about = "Cm about this point of the chord too, as 0.25: 0 is the nose, 1 the tail"
    parser.add_argument("--moment-about", type=float, metavar="X/C", help=about)


def reynolds_of(arguments: argparse.Namespace, chord: float, dimension: int) -> list[float]:
    """Return the Reynolds numbers U D / nu of --reynolds, or of --chord-reynolds for a chord in D.

    Where neither is given it is that of --fluid, if that has a viscosity.

    Raises:
      InvalidInput: none or both are given, or one is outside the range of the solver. Whether
        the flow past the body is stable there is not asked.
    """
    if arguments.reynolds is None and arguments.chord_reynolds is None:
        conditions = conditions_of(getattr(arguments, "fluid", None))
        if conditions is None or conditions.reynolds is None:
            raise InvalidInput(f"--reynolds: give it, or {_others_of_reynolds(arguments)} instead")
        return [check_reynolds(conditions.reynolds, dimension)]
    if arguments.reynolds is not None and arguments.chord_reynolds is not None:
        raise InvalidInput("--reynolds, --chord-reynolds: give one of them, not both")
    if arguments.reynolds is not None:
        values = numbers(arguments.reynolds)
        return [check_reynolds(value, dimension) for value in values]
    values = numbers(arguments.chord_reynolds, "--chord-reynolds")
    try:
        return [check_reynolds(value / chord, dimension) for value in values]
    except InvalidInput as error:
        text = f"--chord-reynolds {arguments.chord_reynolds}, chord {chord:.4g} D: {error}"
        raise InvalidInput(text) from None


def _others_of_reynolds(arguments):
    """Return the options of a command that could stand for --reynolds, as words."""
    words = {
        "chord_reynolds": "--chord-reynolds",
        "fluid": "--fluid with NU",
        "particle": "--particle",
    }
    return " or ".join(word for name, word in words.items() if hasattr(arguments, name))


def check_reference(reference: str, dimension: int, station: float | None) -> None:
    """Raise InvalidInput where coefficients are to be over the chord of a 3-D body.

    Or where ``station``, that of --moment-about, is not a finite number.
    """
    if station is not None:
        finite_number("--moment-about", station)
    if reference == CHORD and dimension == 3:
        raise InvalidInput("--reference chord: is for 2-D bodies; 3-D ones have areas")


def by_reference(row: JsonObject, shape: Shape) -> JsonObject:
    """Return a row with its coefficients converted from D to the reference length that it names.

    By the chord, forces' coefficients are divided by it and the moment's by its square; so are
    those whose derivatives are under "gradient".
    """
    if row["reference"] == DIAMETER:
        return row
    given = {name: power for name, power in KEY_POWERS.items() if row.get(name) is not None}
    converted = {name: row[name] / row["chord"] ** power for name, power in given.items()}
    if row.get("gradient"):
        converted["gradient"] = _gradient_by_chord(row, shape)
    return row | converted


def _gradient_by_chord(row, shape):
    """Return derivatives of coefficients J / c^k by the chord c: dJ / c^k - k J dc / c^(k + 1)."""
    chord, slopes = row["chord"], shape.chord_slopes

    def converted(load, by_diameter):
        power = KEY_POWERS[load]
        return {
            name: (slope - power * row[load] / chord * slopes.get(name, 0.0)) / chord**power
            for name, slope in by_diameter.items()
        }

    if "cd" in row["gradient"]:
        return {load: converted(load, by_d) for load, by_d in row["gradient"].items()}
    return converted("cd", row["gradient"])


def reference_record(reynolds: float, shape: Shape, reference: str = DIAMETER) -> JsonObject:
    """Return Re = U D / nu, Re = U c / nu, the chord, the centroid and the reference length.

    The chord is in D, the centroid in chords from the nose.
    """
    return {
        "reynolds": reynolds,
        "chord": shape.chord,
        "chord_reynolds": reynolds * shape.chord,
        "centroid": centroid_station(shape),
        "reference": reference,
    }


def moment_record(shape: Shape, station: float | None, *loads: float) -> JsonObject:
    """Return Cm about the point of the chord that --moment-about names, from Cd, Cl and Cm by D.

    Without the option the record is empty.
    """
    if station is None:
        return {}
    point = chord_point(shape, station)
    return {"moment_about": station, "cm_about": moment_about(point, *loads)}


def moment_text(row: JsonObject) -> str:
    """Return a row's moment about the point of --moment-about as text; empty without the option."""
    known = row.get("cm_about") is not None
    return f"Cm about {row['moment_about']:g} c {row['cm_about']:.4f}  " if known else ""


def reference_line(row: JsonObject) -> str:
    """Return a line of text on the chord and on the reference length of a row's coefficients."""
    by = "the equivalent diameter D"
    if row["reference"] == CHORD:
        by = "the chord c (Cm by its square)"
    place = f"centroid at {row['centroid']:.4f} c"
    station = row.get("moment_about")
    about = "" if station is None else f"; Cm about: {station:g} c"
    return f"chord {row['chord']:.4f} D, {place}; coefficients by {by}; Re = U D / nu{about}"


def unsteady_remark(row: JsonObject) -> str:
    """Return the remark on an answer at a Reynolds number beyond the onset of instability."""
    return (
        f"Re {row['reynolds']:g} is beyond the estimated onset of instability, Re "
        f"{row['onset']:.3g}: the steady flow is not observed there"
    )
