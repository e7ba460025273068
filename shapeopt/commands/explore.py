"""One self-contained web page for a surrogate: sliders for Re and shape, drag at once, offline.

python scripts/explore.py --surrogate pretrained --out explore.html
"""

from collections.abc import Sequence
from typing import Any

from shapeopt.commands.cli import Parser, emit
from shapeopt.render.page.page import check_page, write_page
from surrogate.model.store import load


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, write the page."""
    parser = Parser(__doc__)
    parser.add_argument("--surrogate", default="pretrained", help="a folder, or pretrained")
    parser.add_argument("--out", required=True, help="the page, .html")
    arguments = parser.parse_args(argv)
    surrogate = load(arguments.surrogate)
    out = check_page(arguments.out)
    write_page(surrogate, out)
    result = {"out": str(out), "bytes": out.stat().st_size, "surrogate": arguments.surrogate}
    return emit(result, arguments.json, f"-> {out} ({result['bytes'] / 1024:.0f} KiB)")
