"""Draw the optimal bodies over Reynolds number and maximum length, or over lift.

python scripts/design_sheet.py --reynolds 1,3,10,40 --max-length 1.2,1.5,2 --out sheet.png
python scripts/design_sheet.py --surrogate pretrained:lift --reynolds 40 --lifts 0:0.6:7 \
    --until flow --out bucket.png

They are the surrogate's own optima, or with --until flow those of the flow, led by the surrogate:
one after the other, each with the flows of those before. With --lifts: the bodies of least Cd whose
Cl is at least each of these, and the one of the best glide ratio Cl / Cd, for surrogates of
sections with camber or incidence.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.problem_arguments import MEMORY_HELP, UNTIL_HELP
from shapeopt.commands.ranges import numbers
from shapeopt.drag_bucket import designs_over_lift
from shapeopt.render.bucket import plot_bucket
from shapeopt.render.designs import plot_designs
from shapeopt.search.designer import Designer
from shapeopt.search.sheet import designs_over
from surrogate.body.parameters import FAMILY
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject, check_file
from surrogate.model.store import load
from surrogate.model.surrogate import Surrogate
from surrogate.progress import progress_bar


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, optimise all bodies in one batch and draw them."""
    arguments = _parser().parse_args(argv)
    out, surrogate = check_file(arguments.out, ".png"), load(arguments.surrogate)
    reynolds = sorted(numbers(arguments.reynolds))
    lengths = []
    if arguments.max_length is not None:
        lengths = sorted(numbers(arguments.max_length, "--max-length", "1.2,1.5,2", "1.2:2:5"))
    if arguments.lifts is not None:
        return _over_lift(arguments, surrogate, reynolds, lengths, out)
    if not lengths:
        raise InvalidInput("--max-length: give it, as 1.2,1.5,2; or --lifts")
    with progress_bar("designs") as progress:
        over = reynolds, lengths, arguments.min_thickness
        rows, seconds = designs_over(_model(arguments, surrogate), *over, progress)
    plot_designs(surrogate.scene.family, rows, out)
    result = {"designs": rows, "seconds": seconds, "out": str(out)}
    return emit(result, arguments.json, "\n".join([*map(_line, rows), f"-> {out}"]))


def _over_lift(
    arguments: argparse.Namespace,
    surrogate: Surrogate,
    reynolds: list[float],
    lengths: list[float],
    out: Path,
) -> JsonObject:
    """Draw the bodies of least drag over bounds on the lift, and that of best glide."""
    if len(reynolds) > 1 or len(lengths) > 1:
        raise InvalidInput("--lifts: goes with one Reynolds number and at most one --max-length")
    lifts = sorted(numbers(arguments.lifts, "--lifts", "0,0.3,0.6", "0:0.6:7", logarithmic=False))
    bounds = {
        "max_length": lengths[0] if lengths else None,
        "min_thickness": arguments.min_thickness,
    }
    with progress_bar("designs") as progress:
        over = reynolds[0], lifts, progress
        rows, best, seconds = designs_over_lift(_model(arguments, surrogate), *over, **bounds)
    plot_bucket(surrogate.scene.family, rows, best, out)
    result = {"designs": rows, "best_glide": best, "seconds": seconds, "out": str(out)}
    lines = [*map(_lift_line, [*rows, best]), f"-> {out}"]
    return emit(result, arguments.json, "\n".join(lines))


def _model(arguments: argparse.Namespace, surrogate: Surrogate) -> Surrogate | Designer:
    """Return what optimises the bodies: the surrogate, or a designer that it leads."""
    if arguments.until == "flow":
        return Designer(surrogate, arguments.memory)
    if arguments.memory is not None:
        raise InvalidInput("--memory: goes with --until flow")
    return surrogate


def _lift_line(row: JsonObject) -> str:
    bound = "best glide" if row["lift"] is None else f"Cl >= {row['lift']:g}"
    lift, glide = (round(row[name], 4) + 0.0 for name in ("cl", "glide"))  # no minus zero
    coefficients = f"Cd {row['cd']:.4f}  Cl {lift:.4f}  Cl/Cd {glide:.4f}"
    return f"Re {row['reynolds']:<6g} {bound:16} {coefficients}{_flows(row)}"


def _line(row: JsonObject) -> str:
    bound = "any length" if row["max_length"] is None else f"length <= {row['max_length']:g} D"
    drag = f"Cd {row['cd']:.4f}  {row['excess']:+.2%}"
    return f"Re {row['reynolds']:<6g} {bound:16} {drag}{_flows(row)}"


def _flows(row: JsonObject) -> str:
    """The flows and the KKT residual of an optimum of the flow, as text."""
    if not row["flows"]:
        return ""
    return f"  {row['flows']} flows, KKT residual {row['kkt_residual']:.0e}"


def _parser() -> Parser:
    parser = Parser(__doc__)
    add = parser.add_argument
    add("--surrogate", default="pretrained", help="folder, or pretrained[:METHOD]")
    add("--reynolds", required=True, help="one, several as 1,3,10,40, or 1:40:log5")
    add("--max-length", help="bounds on the chord in D, as 1.2,1.5,2")
    add("--lifts", help="lower bounds on Cl, as 0,0.3,0.6 or 0:0.6:7, at one Reynolds number")
    add("--min-thickness", type=float, help="lower bound on the maximum thickness in D (none)")
    add("--until", choices=["surrogate", "flow"], default="surrogate", help=UNTIL_HELP)
    add("--memory", help=MEMORY_HELP)
    add("--out", required=True, help="picture, .png")
    parser.add_argument_group("bodies of the family", FAMILY)
    return parser
