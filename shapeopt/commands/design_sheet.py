"""Draw the optimal bodies over Reynolds number and maximum length, or over lift.

python scripts/design_sheet.py --reynolds 1,3,10,40 --max-length 1.2,1.5,2 --out sheet.png
python scripts/design_sheet.py --surrogate pretrained:lift --reynolds 40 --lifts 0:0.6:7 \\
    --until flow --out over_lift.png
python scripts/design_sheet.py --surrogate pretrained:lift --chord-reynolds 100 --lifts 0:0.4:5 \\
    --min-thickness 0.3 --out sections.png

They are the surrogate's own optima, or with --until flow those of the flow, led by the surrogate,
or with --surrogate none by the flows alone: one after the other, each with the flows of those
before. With --lifts: the bodies of least Cd whose Cl is at least each of these, and the one of the
best glide ratio Cl / Cd, for sections with camber or incidence; optimize_shape.py --lift finds one
section for several lifts.
"""

import argparse
from collections.abc import Sequence

from shapeopt.commands.arguments import REYNOLDS_HELP
from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.objective_arguments import CHORD_HELP
from shapeopt.commands.problem_arguments import (
    add_constraint_arguments,
    add_model_arguments,
    add_search_arguments,
    constraints_of,
    ends_on_flow,
    scene_of,
    surrogate_of,
)
from shapeopt.commands.ranges import numbers
from shapeopt.commands.reference import CHORD, DIAMETER, SEVERAL, unsteady_remark
from shapeopt.commands.sweep import check_outputs, write_table
from shapeopt.render.designs import plot_designs
from shapeopt.render.over_lift import plot_over_lift
from shapeopt.search.designer import Designer
from shapeopt.search.over_lift import designs_over_lift
from shapeopt.search.sheet import designs_over
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import JsonObject, check_file
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate
from surrogate.progress import progress_bar


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, optimise all bodies and draw them.

    Raises:
      NotConverged: a body was not found; those found are drawn and printed.
    """
    arguments = _parser().parse_args(argv)
    check_outputs(arguments.table, None)
    out = check_file(arguments.out, ".png", ".svg", ".pdf")
    surrogate = surrogate_of(arguments)
    model = _model(arguments, surrogate)
    until = "flow" if isinstance(model, Designer) else "surrogate"
    warning = surrogate.inaccuracy if surrogate else None
    common = {"surrogate": arguments.surrogate, "warning": warning, "until": until, "out": str(out)}
    reynolds = _reynolds(arguments)
    lengths = []
    if arguments.max_length is not None:
        lengths = numbers(arguments.max_length, "--max-length", "1.2,1.5,2", "1.2:2:5")
    lengths = sorted(set(lengths))
    if arguments.lifts is not None:
        return _over_lift(arguments, model, common, reynolds, lengths)
    if not lengths:
        raise InvalidInput("--max-length: give it, as 1.2,1.5,2; or --lifts")
    bounds = constraints_of(arguments)
    with progress_bar("designs") as progress:
        rows, seconds = designs_over(model, reynolds, lengths, progress, **bounds)
    plot_designs(model.scene.family, [row for row in rows if row["excess"] is not None], out)
    result = {"designs": rows, "seconds": seconds, **common}
    return _emitted(result, arguments, rows, [_length(row) for row in rows])


def _over_lift(
    arguments: argparse.Namespace,
    model: Surrogate | Designer,
    common: JsonObject,
    reynolds: list[float],
    lengths: list[float],
) -> JsonObject:
    """Draw the bodies of least drag over bounds on the lift, and that of best glide."""
    if len(reynolds) > 1 or len(lengths) > 1:
        raise InvalidInput("--lifts: goes with one Reynolds number and at most one --max-length")
    lifts = numbers(arguments.lifts, "--lifts", "0,0.3,0.6", "0:0.6:7", logarithmic=False)
    bounds = constraints_of(arguments) | {"max_length": lengths[0] if lengths else None}
    bounds["by_chord"] = arguments.chord_reynolds is not None
    lifts = sorted(set(lifts))
    with progress_bar("designs") as progress:
        rows, best, seconds = designs_over_lift(model, reynolds[0], lifts, progress, **bounds)
    found, by_chord = [row for row in rows if not row["why_not"]], bounds["by_chord"]
    glider = None if best["why_not"] else best
    plot_over_lift(model.scene.family, found, glider, common["out"], by_chord)
    reference = CHORD if by_chord else DIAMETER
    result = {"designs": rows, "best_glide": best, "seconds": seconds, "reference": reference}
    result |= common
    bodies = [*rows, best]
    return _emitted(result, arguments, bodies, [_lift(row) for row in bodies])


def _reynolds(arguments: argparse.Namespace) -> list[float]:
    """Return the Reynolds numbers, by D or of --chord-reynolds, in ascending order."""
    by_diameter, by_chord = arguments.reynolds, arguments.chord_reynolds
    if (by_diameter is None) == (by_chord is None):
        raise InvalidInput("--reynolds, --chord-reynolds: give one of them")
    if by_chord is None:
        return sorted(set(numbers(by_diameter)))
    if arguments.lifts is None:
        raise InvalidInput("--chord-reynolds: goes with --lifts; with --max-length chords differ")
    return sorted(set(numbers(by_chord, "--chord-reynolds")))


def _emitted(
    result: JsonObject, arguments: argparse.Namespace, rows: list[JsonObject], bounds: list[str]
) -> JsonObject:
    """Print the result, a line for every body with its bound, write the table, and return it.

    Raises:
      NotConverged: a body was not found.
    """
    if arguments.table:
        write_table(rows, arguments.table)
    pairs = list(zip(rows, bounds, strict=True))
    on_flow = result["until"] == "flow"
    lines = [f"{_at(row, result):10} {bound:16} {_line(row, on_flow)}" for row, bound in pairs]
    lines += ["  coefficients are over the chord"] * (result.get("reference") == CHORD)
    late = [row for row in rows if row["onset"] and row["reynolds"] > row["onset"]]
    lines += [f"  {unsteady_remark(min(late, key=lambda row: row['onset']))}"] if late else []
    ends = sorted({name for row in rows for name in row["at_range_ends"] or ()})
    lines += [f"  some bodies at the end of the range of {', '.join(ends)}"] if ends else []
    emit(result, arguments.json, "\n".join([*lines, f"-> {result['out']}"]))
    if lost := [(row, bound) for row, bound in pairs if row["why_not"]]:
        row, bound = lost[0]
        reason = f"{bound} at {_at(row, result)}: {row['why_not']}"
        raise NotConverged(f"{len(lost)} of {len(rows)} bodies were not found: {reason}")
    return result


def _model(arguments: argparse.Namespace, surrogate: Surrogate | None) -> Surrogate | Designer:
    """Return what optimises the bodies: the surrogate, or a designer that it or the flow leads."""
    on_flow = ends_on_flow(arguments, surrogate)
    if surrogate is None:
        return Designer(Flow(scene_of(arguments)), arguments.memory)
    return Designer(surrogate, arguments.memory) if on_flow else surrogate


def _at(row: JsonObject, result: JsonObject) -> str:
    """Return the Reynolds number of a row as text, by the chord where the coefficients are."""
    if result.get("reference") == CHORD:
        return f"chord Re {row['chord_reynolds']:g}"
    return f"Re {row['reynolds']:g}"


def _lift(row: JsonObject) -> str:
    return "best glide" if row["lift"] is None else f"Cl >= {row['lift']:g}"


def _length(row: JsonObject) -> str:
    return "any length" if row["max_length"] is None else f"length <= {row['max_length']:g} D"


def _line(row: JsonObject, on_flow: bool) -> str:
    """Return the coefficients of a body, and the work of an optimum of the flow, as text."""
    if row["why_not"]:
        return "not found"
    parts = [f"Cd {row['cd']:.4f}"]
    if "lift" in row:
        lift, glide = (round(row[name], 4) + 0.0 for name in ("cl", "glide"))  # no minus zero
        parts.append(f"Cl {lift:.4f}  Cl/Cd {glide:.4f}")
    elif row["excess"] is not None:
        parts.append(f"{round(row['excess'], 4) + 0.0:+.2%}")  # no minus zero
    if on_flow:
        parts.append(f"{row['flows']} flows, KKT residual {row['kkt_residual']:.0e}")
    parts.append(", ".join(f"{name} {value:.4g}" for name, value in row["parameters"].items()))
    return "  ".join(parts)


def _parser() -> Parser:
    parser = Parser(__doc__)
    add = parser.add_argument
    add_model_arguments(parser)
    add("--reynolds", help=f"{SEVERAL}: {REYNOLDS_HELP}")
    add("--chord-reynolds", help=f"with --lifts: {CHORD_HELP}")
    add("--max-length", help="bounds on the chord in D, as 1.2,1.5,2")
    add(
        "--lifts",
        help="lower bounds on Cl, as 0,0.3,0.6 or 0:0.6:7, at one Reynolds number",
    )
    add_constraint_arguments(parser)
    add_search_arguments(parser)
    add("--table", help="CSV file of the bodies, with their parameters and coefficients")
    add("--out", required=True, help="picture, .png, .svg or .pdf")
    return parser
