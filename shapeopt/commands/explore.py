"""Write a surrogate as one web page: sliders for Re and shape, drag at once, offline.

python scripts/explore.py --surrogate pretrained --out explore.html
"""

from collections.abc import Sequence

from shapeopt.commands.arguments import add_surrogate_argument
from shapeopt.commands.cli import Parser, emit
from shapeopt.render.page.page import write_page
from surrogate.files import JsonObject, check_file
from surrogate.model.store import load


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments and write the page."""
    parser = Parser(__doc__)
    add_surrogate_argument(parser)
    parser.add_argument("--out", required=True, help="file, .html")
    arguments = parser.parse_args(argv)
    surrogate = load(arguments.surrogate)
    out = check_file(arguments.out, ".html")
    write_page(surrogate, out)
    result = {"out": str(out), "bytes": out.stat().st_size, "surrogate": arguments.surrogate}
    return emit(result, arguments.json, f"-> {out} ({result['bytes'] / 1024:.0f} KiB)")
