"""Write a surrogate to one file that needs no JAX: C, Fortran, NumPy or ONNX.

python scripts/export_surrogate.py --surrogate pretrained --to c --out surrogate.c
python scripts/export_surrogate.py --to fortran --prefix drag --precision single --out drag.f90
python scripts/export_surrogate.py --surrogate pretrained:space --to numpy --out space.py

The file has the weights, the loads and their exact derivatives, and flags for the trained ranges.
"""

from collections.abc import Sequence

from shapeopt.commands.arguments import add_surrogate_argument
from shapeopt.commands.cli import Parser, emit
from surrogate.exports.export import PREFIX, TARGETS, export
from surrogate.exports.literals import PRECISIONS
from surrogate.files import JsonObject
from surrogate.model.store import load


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments and write the file."""
    parser = Parser(__doc__)
    add_surrogate_argument(parser)
    parser.add_argument(
        "--to", type=str.lower, required=True, choices=TARGETS, help="language of the file"
    )
    parser.add_argument("--out", required=True, help="file: .c, .f90, .py or .onnx")
    names = f"prefix of the names in C, Fortran and ONNX ({PREFIX})"
    parser.add_argument("--prefix", help=names)
    parser.add_argument(
        "--precision", default="double", choices=PRECISIONS, help="precision of all numbers"
    )
    arguments = parser.parse_args(argv)
    surrogate = load(arguments.surrogate)
    out = export(
        surrogate,
        arguments.out,
        arguments.to,
        precision=arguments.precision,
        prefix=arguments.prefix,
    )
    result = {
        "out": str(out),
        "bytes": out.stat().st_size,
        "to": arguments.to,
        "precision": arguments.precision,
        "surrogate": arguments.surrogate,
    }
    return emit(result, arguments.json, f"-> {out} ({result['bytes'] / 1024:.0f} KiB)")
