"""Drag, lift and their gradient of one body by the flow solver.

python scripts/solve_drag.py --aspect 1 --reynolds 1,10,40
python scripts/solve_drag.py --naca 0012 --incidence 10 --reynolds 20 --stream tunnel:8 --json
"""

import dataclasses
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from common import (
    Parser,
    add_family_arguments,
    emit,
    family_parameters,
    fidelity_of,
    progress_bar,
    reynolds_numbers,
    run,
)

from surrogate.body import rotate
from surrogate.contour import naca4, read_contour, smooth_contour
from surrogate.errors import InvalidInput
from surrogate.flow.drag import DragReport, body_domain, family_body, report
from surrogate.scene import Fidelity, parse_stream

NODES_TO_CHECK = 400


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, solve every Reynolds number, report."""
    arguments = _parser().parse_args(argv)
    reynolds = reynolds_numbers(arguments.reynolds, arguments.allow_unsteady)
    fidelity = _fidelity(arguments)
    stream = parse_stream(arguments.stream)
    make, parameters, symmetric = _body(arguments)
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
    add_family_arguments(parser)
    parser.add_argument("--contour", help="CSV of x,y or Selig .dat, scaled to area pi/4")
    parser.add_argument("--naca", help="NACA 4-digit section, as 0012")
    parser.add_argument("--incidence", type=float, default=0.0, help="nose up, in degrees")
    parser.add_argument("--keep-size", action="store_true", help="do not scale a contour")
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


def _body(arguments):
    """(nodes -> markers, family parameters or None, symmetric)."""
    given = [name for name in ("aspect", "contour", "naca") if getattr(arguments, name) is not None]
    if len(given) != 1:
        raise InvalidInput("body: give exactly one of --aspect, --contour and --naca")
    if not abs(arguments.incidence) <= 180:
        raise InvalidInput(f"--incidence {arguments.incidence:g}: from -180 to 180 degrees")
    if arguments.aspect is not None:
        parameters = np.array(family_parameters(arguments))
        symmetric = arguments.incidence == 0
        if arguments.gradient and not symmetric:
            raise InvalidInput("--gradient: is for family bodies at zero incidence")

        def make(nodes):
            return family_body(parameters, nodes, arguments.incidence)

        return make, parameters, symmetric
    if arguments.gradient:
        raise InvalidInput("--gradient: is for family bodies (--aspect), not for contours")
    points = read_contour(arguments.contour) if arguments.contour else naca4(arguments.naca)

    def make(nodes):
        contour = smooth_contour(points, nodes, arguments.keep_size)
        return np.asarray(rotate(contour, arguments.incidence))

    return make, None, False


def _line(r: DragReport) -> str:
    line = (
        f"Re {r.reynolds:<8g} Cd {r.cd:.4f} (pressure {r.cd_pressure:.3f}, friction "
        f"{r.cd_friction:.3f})  Cl {r.cl:.4f}  {r.iterations} Newton steps, "
        f"{r.green_applications} applications of G, {r.wall_s:.2f} s"
    )
    if r.gradient:
        line += "\n  dCd/d" + "  ".join(
            f"{name}: {value:+.5f}" for name, value in r.gradient.items()
        )
    return line


if __name__ == "__main__":
    sys.exit(run(main))
