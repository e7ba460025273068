"""The designs of a surrogate over Reynolds number and length, as one sheet of bodies.

python scripts/design_sheet.py --reynolds 1,3,10,40 --max-length 1.2,1.5,2 --out sheet.png
"""

from collections.abc import Sequence
from typing import Any

from shapeopt.commands.cli import Parser, emit, numbers
from shapeopt.render.designs import plot_designs
from shapeopt.render.signature import check_picture
from shapeopt.search.sheet import designs_over
from surrogate.model.store import load


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, design all in one call, draw."""
    arguments = _parser().parse_args(argv)
    out, surrogate = check_picture(arguments.out, ".png"), load(arguments.surrogate)
    reynolds = sorted(numbers(arguments.reynolds))
    lengths = sorted(numbers(arguments.max_length, "--max-length", "1.2,1.5,2"))
    rows, seconds = designs_over(surrogate, reynolds, lengths, arguments.min_thickness)
    plot_designs(surrogate.scene.family, rows, out)
    result = {"designs": rows, "seconds": seconds, "out": str(out)}
    return emit(result, arguments.json, "\n".join([*map(_line, rows), f"-> {out}"]))


def _line(row):
    bound = "any length" if row["max_length"] is None else f"length <= {row['max_length']:g} D"
    return f"Re {row['reynolds']:<6g} {bound:16} Cd {row['cd']:.4f}  {row['excess']:+.2%}"


def _parser():
    parser = Parser(__doc__)
    parser.add_argument(
        "--surrogate", default="pretrained", help="a folder, or pretrained[:METHOD] (pretrained)"
    )
    parser.add_argument("--reynolds", required=True, help="one or several: 1,3,10,40")
    parser.add_argument("--max-length", required=True, help="bounds on the chord in D: 1.2,1.5,2")
    parser.add_argument("--min-thickness", type=float, help="of every body in D (no bound)")
    parser.add_argument("--out", required=True, help="the sheet, .png")
    return parser
