"""Drag, lift, moment and the gradient of the drag of one body by the flow solver.

python scripts/solve_drag.py --aspect 1 --reynolds 1,10,40
python scripts/solve_drag.py --dimension 3 --aspect 2 --flatness 1.5 --reynolds 40
python scripts/solve_drag.py --dimension 3 --aspect 0.5 --settling 2.65,1e-6,2e-4
python scripts/solve_drag.py --naca 0012 --incidence 10 --reynolds 20 --stream tunnel:8 --json
"""

import argparse
import dataclasses
from collections.abc import Sequence

from shapeopt.commands.arguments import (
    REYNOLDS_HELP,
    add_body_arguments,
    reynolds_numbers,
    shape_of,
)
from shapeopt.commands.cli import Parser, emit, numbers
from surrogate.body.family import Family
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject
from surrogate.flow.flow import Flow
from surrogate.flow.settling import RANGE, Particle, settle
from surrogate.flow.solution import Solution
from surrogate.progress import progress_bar
from surrogate.scene.fidelity import read_fidelity
from surrogate.scene.limits import check_reynolds
from surrogate.scene.scene import Scene
from surrogate.scene.stream import parse_stream


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, solve at every Reynolds number, report."""
    arguments = _parser().parse_args(argv)
    dimension = arguments.dimension
    if (arguments.reynolds is None) == (arguments.settling is None):
        raise InvalidInput("--reynolds: give it, or --settling instead")
    if arguments.settling is not None:
        if arguments.gradient or arguments.allow_unsteady:
            raise InvalidInput("--settling: goes without --gradient and --allow-unsteady")
        return _settling(arguments)
    reynolds = reynolds_numbers(arguments.reynolds, arguments.allow_unsteady, dimension)
    scene, shape = _scene(arguments, reynolds), shape_of(arguments, dimension)
    for value in reynolds:  # all, before the first is solved
        check_reynolds(value, arguments.allow_unsteady, dimension, shape.extent)
    if arguments.gradient and (shape.parameters is None or not shape.symmetric):
        raise InvalidInput("--gradient: needs a family body (--aspect) at zero incidence")
    flow, results = Flow(scene), []
    with progress_bar("body flow") as progress:
        for k, value in enumerate(reynolds):
            solution = flow.solve(
                shape,
                value,
                gradient=arguments.gradient,
                allow_unsteady=arguments.allow_unsteady,
            )
            results.append(_row(solution))
            progress((k + 1) / len(reynolds), f"Re {value:g}: Cd {solution.drag:.4f}")
    result = {"results": results, "scene": scene.record}
    return emit(result, arguments.json, "\n".join(map(_line, results)))


def _settling(arguments: argparse.Namespace) -> JsonObject:
    """Report the terminal velocity of a particle, and its flow there."""
    values = numbers(arguments.settling, "--settling", "2.65,1e-6,2e-4")
    if len(values) != 3:
        raise InvalidInput(f"--settling {arguments.settling}: density ratio,viscosity,size")
    particle = Particle(*values)
    scene, shape = _scene(arguments, RANGE), shape_of(arguments, arguments.dimension)
    settled = settle(Flow(scene), shape, particle)
    row = _row(settled.solution)
    row |= {"velocity": settled.velocity, "settling_reynolds": settled.reynolds}
    drag = settled.solution.drag * settled.solution.reynolds / settled.reynolds
    turns = bool(shape.extent[0] > 1.01 * min(shape.extent[1:]))
    row |= {"settling_cd": drag, "flows": settled.flows, "turns_when_free": turns}
    result = {"results": [row], "scene": scene.record}
    verb = "falls" if particle.density_ratio > 1 else "rises"
    text = f"{verb} along its axis at {settled.velocity:.4g} m/s, Re {settled.reynolds:.3g}, "
    text += f"Cd {drag:.5g} ({settled.flows} flow{'s'[: settled.flows - 1]})\n{_line(row)}"
    if turns:
        text += "\nwith its axis held vertical; a free body turns its broad side to its fall"
    return emit(result, arguments.json, text)


def _scene(arguments: argparse.Namespace, reynolds: Sequence[float]) -> Scene:
    fidelity = read_fidelity(arguments.fidelity, arguments.dimension)
    if arguments.cells is not None:
        if not 4 <= arguments.cells <= 64:
            raise InvalidInput(f"--cells {arguments.cells}: a whole number from 4 to 64 is needed")
        fidelity = dataclasses.replace(fidelity, cells=arguments.cells)
    stream = parse_stream(arguments.stream)
    family = Family(dimension=arguments.dimension)
    return Scene(stream, (min(reynolds), max(reynolds)), family, fidelity)


def _row(s: Solution) -> JsonObject:
    return {
        "reynolds": s.reynolds,
        "cd": s.drag,
        "cd_extrapolated": s.extrapolated_drag,
        "cd_pressure": s.drag_pressure,
        "cd_friction": s.drag_friction,
        "cl": s.lift,
        "cm": s.moment,
        "converged": True,
        "iterations": s.newton_steps,
        "green_applications": s.green_applications,
        "wall_s": s.seconds,
        "gradient": s.gradient,
        "expected_error": s.expected_error,
        "estimated_error": s.estimated_error,
        "estimated_lift_error": s.estimated_lift_error,
        "sufficient": s.sufficient,
        "status": s.status,
        "accuracy": s.accuracy,
    }


def _line(r: JsonObject) -> str:
    estimate, lift = r["accuracy"], f"Cl {r['cl']:.4f}"
    if r["estimated_lift_error"]:
        lift += f" +- {r['estimated_lift_error']:.4f}"
    if r["cd_extrapolated"]:
        estimate += f", extrapolated Cd {r['cd_extrapolated']:.4f}"
    line = (
        f"Re {r['reynolds']:<8g} Cd {r['cd']:.4f} (pressure {r['cd_pressure']:.3f}, friction "
        f"{r['cd_friction']:.3f})  {lift}  Cm {r['cm']:.4f}  {r['iterations']} Newton steps, "
        f"{r['green_applications']} convolutions, {r['wall_s']:.2f} s, {estimate}"
    )
    if r["gradient"]:
        slopes = (f"{name}: {value:+.5f}" for name, value in r["gradient"].items())
        line += "\n  dCd/d" + "  ".join(slopes)
    return line


def _parser() -> Parser:
    parser = Parser(__doc__)
    add_body_arguments(parser)
    settling = (
        "3-D: terminal velocity for RATIO,NU,D: density over the fluid's, kinematic viscosity "
        "in m^2/s, diameter of the sphere of equal volume in m"
    )
    add = parser.add_argument
    add("--reynolds", help=f"one, or several as 1,10,40: {REYNOLDS_HELP}")
    add("--settling", help=settling)
    add("--dimension", type=int, choices=(2, 3), default=2, help="2-D or 3-D flow (2)")
    add("--stream", default="unbounded", help="unbounded (default) or tunnel:H, H in D")
    add("--fidelity", default="standard", help="draft, standard (default) or fine")
    add("--cells", type=int, help="cells per D, 4 to 64, instead of the fidelity's")
    add("--gradient", action="store_true", help="dCd/d(parameters, Re)")
    unsteady = "beyond the onset of shedding: Re 46.7, in 3-D 210, sooner for tall bodies"
    add("--allow-unsteady", action="store_true", help=unsteady)
    return parser
