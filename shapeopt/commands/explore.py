"""One self-contained web page for a surrogate: sliders for Re and shape, drag at once, offline.

python scripts/explore.py --surrogate pretrained --out explore.html
"""

import sys
from collections.abc import Sequence
from typing import Any

from common import Parser, emit, run

from shapeopt.render.page.page import write_page
from surrogate.files import check_file
from surrogate.model.store import load_surrogate


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, write the page."""
    arguments = _parser().parse_args(argv)
    out = check_file(arguments.out, ".html")
    write_page(load_surrogate(arguments.surrogate), out)
    result = {"out": str(out), "bytes": out.stat().st_size, "surrogate": arguments.surrogate}
    return emit(result, arguments.json, f"-> {out} ({result['bytes'] / 1024:.0f} KiB)")


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--surrogate", default="pretrained", help="a folder, or pretrained")
    parser.add_argument("--out", required=True, help="the page, .html")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
