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
    emit,
    fidelity_of,
    progress_bar,
    reynolds_numbers,
    run,
    shape_of,
)

from surrogate.errors import InvalidInput
from surrogate.flow.check.trust import fitted_domain, judge, solve_shape
from surrogate.scene.scene import Fidelity, parse_stream


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, solve every Reynolds number, report."""
    arguments = _parser().parse_args(argv)
    reynolds = reynolds_numbers(arguments.reynolds, arguments.allow_unsteady)
    fidelity = _fidelity(arguments)
    stream = parse_stream(arguments.stream)
    shape = shape_of(arguments)
    if arguments.gradient and (shape.parameters is None or not shape.symmetric):
        raise InvalidInput("--gradient: is for family bodies (--aspect) at zero incidence")
    for value in reynolds:
        fitted_domain(shape, stream, fidelity, value)  # refuses what cannot be solved
    results = []
    with progress_bar("body flow") as progress:
        for k, value in enumerate(reynolds):
            progress(k / len(reynolds), f"Re {value:g}")
            found = solve_shape(shape, stream, fidelity, value, arguments.gradient)
            trust = judge(found.cd, shape, stream, fidelity, value)
            results.append(dataclasses.asdict(found) | trust._asdict())
            progress((k + 1) / len(reynolds), f"Re {value:g}: Cd {found.cd:.4f}")
    scene = {"stream": arguments.stream, "fidelity": dataclasses.asdict(fidelity)}
    result = {"results": results, "scene": scene}
    return emit(result, arguments.json, "\n".join(map(_line, results)))


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


def _line(r: dict[str, Any]) -> str:
    error = r["estimated_error"]
    line = (
        f"Re {r['reynolds']:<8g} Cd {r['cd']:.4f} (pressure {r['cd_pressure']:.3f}, friction "
        f"{r['cd_friction']:.3f})  Cl {r['cl']:.4f}  Cm {r['cm']:.4f}  {r['iterations']} Newton "
        f"steps, {r['green_applications']} applications of G, {r['wall_s']:.2f} s, {r['status']}: "
        + ("no estimate of the error" if error is None else f"error about {100 * error:.2f} %")
    )
    if r["gradient"]:
        line += "\n  dCd/d" + "  ".join(
            f"{name}: {value:+.5f}" for name, value in r["gradient"].items()
        )
    return line


if __name__ == "__main__":
    sys.exit(run(main))
