"""Drag, lift and their gradient of one body by the flow solver.

python scripts/solve_drag.py --aspect 1 --reynolds 1,10,40
python scripts/solve_drag.py --naca 0012 --incidence 10 --reynolds 20 --stream tunnel:8 --json
"""

import dataclasses
import sys
from collections.abc import Sequence
from typing import Any

from common import (
    Parser,
    add_body_arguments,
    body_of,
    emit,
    fidelity_of,
    progress_bar,
    reynolds_numbers,
    run,
)

from surrogate.errors import InvalidInput
from surrogate.flow.drag import DragReport, body_domain, report
from surrogate.scene import Fidelity, parse_stream

NODES_TO_CHECK = 400


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, solve every Reynolds number, report."""
    arguments = _parser().parse_args(argv)
    reynolds = reynolds_numbers(arguments.reynolds, arguments.allow_unsteady)
    fidelity = _fidelity(arguments)
    stream = parse_stream(arguments.stream)
    make, parameters, symmetric = body_of(arguments)
    if arguments.gradient and (parameters is None or not symmetric):
        raise InvalidInput("--gradient: is for family bodies (--aspect) at zero incidence")
    domain = body_domain(stream, fidelity, make(NODES_TO_CHECK), symmetric)
    markers = make(domain.nodes)
    reports = []
    with progress_bar("body flow") as progress:
        for k, value in enumerate(reynolds):
            progress(k / len(reynolds), f"Re {value:g}")
            wanted = parameters if arguments.gradient else None
            reports.append(report(domain, markers, value, wanted))
            progress((k + 1) / len(reynolds), f"Re {value:g}: Cd {reports[-1].cd:.4f}")
    scene = {
        "stream": arguments.stream,
        "fidelity": dataclasses.asdict(fidelity),
        "window_cells": list(domain.lattice.shape),
        "markers": domain.nodes,
    }
    result = {"results": [dataclasses.asdict(r) for r in reports], "scene": scene}
    return emit(result, arguments.json, "\n".join(map(_line, reports)))


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    add_body_arguments(parser)
    parser.add_argument("--reynolds", required=True, help="U D / nu, one or several: 1,10,40")
    parser.add_argument("--stream", default="unbounded", help="unbounded or tunnel:H")
    parser.add_argument("--fidelity", default="standard", help="draft, standard or fine")
    parser.add_argument("--cells", type=int, help="cells per D, instead of the fidelity's")
    parser.add_argument("--gradient", action="store_true", help="dCd/d(parameters, Re)")
    parser.add_argument("--allow-unsteady", action="store_true", help="steady flow past Re 46.7")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


def _fidelity(arguments) -> Fidelity:
    fidelity = fidelity_of(arguments.fidelity)
    if arguments.cells is None:
        return fidelity
    if not 4 <= arguments.cells <= 64:
        raise InvalidInput(f"--cells {arguments.cells}: a whole number from 4 to 64 is needed")
    return dataclasses.replace(fidelity, cells=arguments.cells)


def _line(r: DragReport) -> str:
    line = (
        f"Re {r.reynolds:<8g} Cd {r.cd:.4f} (pressure {r.cd_pressure:.3f}, friction "
        f"{r.cd_friction:.3f})  Cl {r.cl:.4f}  Cm {r.cm:.4f}  {r.iterations} Newton steps, "
        f"{r.green_applications} applications of G, {r.wall_s:.2f} s"
    )
    if r.gradient:
        line += "\n  dCd/d" + "  ".join(
            f"{name}: {value:+.5f}" for name, value in r.gradient.items()
        )
    return line


if __name__ == "__main__":
    sys.exit(run(main))
