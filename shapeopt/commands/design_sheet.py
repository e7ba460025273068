"""Draw the optimal bodies of a surrogate over Reynolds number and maximum length.

python scripts/design_sheet.py --reynolds 1,3,10,40 --max-length 1.2,1.5,2 --out sheet.png
"""

from collections.abc import Sequence

from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.ranges import numbers
from shapeopt.render.designs import plot_designs
from shapeopt.search.sheet import designs_over
from surrogate.files import JsonObject, check_file
from surrogate.model.store import load


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, optimise all bodies in one batch, draw them."""
    arguments = _parser().parse_args(argv)
    out, surrogate = check_file(arguments.out, ".png"), load(arguments.surrogate)
    reynolds = sorted(numbers(arguments.reynolds))
    lengths = sorted(numbers(arguments.max_length, "--max-length", "1.2,1.5,2", "1.2:2:5"))
    rows, seconds = designs_over(surrogate, reynolds, lengths, arguments.min_thickness)
    plot_designs(surrogate.scene.family, rows, out)
    result = {"designs": rows, "seconds": seconds, "out": str(out)}
    return emit(result, arguments.json, "\n".join([*map(_line, rows), f"-> {out}"]))


def _line(row: JsonObject) -> str:
    bound = "any length" if row["max_length"] is None else f"length <= {row['max_length']:g} D"
    return f"Re {row['reynolds']:<6g} {bound:16} Cd {row['cd']:.4f}  {row['excess']:+.2%}"


def _parser() -> Parser:
    parser = Parser(__doc__)
    add = parser.add_argument
    add("--surrogate", default="pretrained", help="folder, or pretrained[:METHOD]")
    add("--reynolds", required=True, help="one, several as 1,3,10,40, or 1:40:log5")
    add("--max-length", required=True, help="bounds on the chord in D, as 1.2,1.5,2")
    add("--min-thickness", type=float, help="lower bound on the maximum thickness in D (none)")
    add("--out", required=True, help="picture, .png")
    return parser
