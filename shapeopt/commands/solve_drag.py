"""Drag, lift and moment of one body, and their gradients, by the flow solver.

python scripts/solve_drag.py --aspect 1 --reynolds 1,10,40
python scripts/solve_drag.py --dimension 3 --aspect 2 --flatness 1.5 --reynolds 40
python scripts/solve_drag.py --dimension 3 --aspect 0.5 --particle 2.65,1e-6,2e-4
python scripts/solve_drag.py --naca 0012 --incidence 10 --reynolds 20 --stream tunnel:8 --json
python scripts/solve_drag.py --naca 2412 --incidence -4:12:5 --chord-reynolds 60 \\
    --reference chord --table polar.csv --plot polar.png
"""

import argparse
import dataclasses
import math
from collections.abc import Sequence

from shapeopt.commands.arguments import (
    add_body_arguments,
    body_record,
    refusals_by_options,
    shape_of,
    shapes_of,
)
from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.kept_flows import add_kept_arguments, kept_flows
from shapeopt.commands.newtons import forces_line
from shapeopt.commands.particle import add_particle_argument, particle_line, particle_of
from shapeopt.commands.reference import (
    CHORD,
    add_reference_argument,
    add_reynolds_arguments,
    by_reference,
    check_reference,
    moment_record,
    moment_text,
    reference_line,
    reynolds_of,
    unsteady_remark,
)
from shapeopt.commands.sweep import (
    Case,
    add_sweep_arguments,
    check_converged,
    check_outputs,
    polar_title,
    solve_cases,
    text_table,
    write_table,
)
from surrogate.body.family import Family
from surrogate.body.parameters import INCIDENCE
from surrogate.body.shape import FamilyShape, family_shape
from surrogate.checks import whole_number
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject
from surrogate.flow.flow import Flow
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.flow.settling import RANGE, settle
from surrogate.flow.solution import Solution
from surrogate.scene.fidelity import MOST_CELLS, read_fidelity
from surrogate.scene.limits import check_reynolds, onset_of
from surrogate.scene.scene import Scene
from surrogate.scene.stream import parse_stream


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, solve the flow at every incidence and Reynolds number, and report."""
    arguments = _parser().parse_args(argv)
    if arguments.particle is not None:
        _check_settling(arguments)
        return _settling(arguments)
    scene, cases = _cases(arguments)
    keep = kept_flows(arguments, cases)
    flow = Flow(scene)

    def solve(case: Case) -> JsonObject:
        solution = flow.solve(
            case.shape,
            case.reynolds,
            gradient=arguments.gradient,
            allow_unsteady=arguments.allow_unsteady,
        )
        about = moment_record(case.shape, arguments.moment_about, *solution.loads.tolist())
        row = by_reference(case.record | _row(solution) | about, case.shape)
        return row | keep(case, solution)

    results = solve_cases(cases, solve, arguments.table)
    if arguments.table:
        write_table(results, arguments.table)
    if arguments.plot:
        from shapeopt.render.polar import plot_polar  # matplotlib takes half a second to import

        plot_polar(results, polar_title(arguments, results[0]), arguments.plot)
    record = {"results": results, "scene": _record(scene), "body": body_record(arguments)}
    result = emit(record, arguments.json, _text(results))
    check_converged(results)
    return result


def _cases(arguments: argparse.Namespace) -> tuple[Scene, list[Case]]:
    """Return the scene and a case for every incidence at every Re.

    Raises:
      InvalidInput: a case cannot be answered, or a file cannot be written.
    """
    dimension = arguments.dimension
    check_reference(arguments.reference, dimension, arguments.moment_about)
    shapes = shapes_of(arguments, dimension)
    chord = next(iter(shapes.values())).chord
    reynolds = reynolds_of(arguments, chord, dimension)
    cases = [
        Case(shape, incidence, value, arguments.reference)
        for incidence, shape in shapes.items()
        for value in reynolds
    ]
    if arguments.gradient and any(shape.parameters is None for shape in shapes.values()):
        raise InvalidInput("--gradient: needs a family body (--aspect)")
    check_outputs(arguments.table, arguments.plot)
    if arguments.plot and len(cases) < 2:
        raise InvalidInput("--plot: needs several values of --incidence or --reynolds")
    scene = _scene(arguments, reynolds)
    for incidence, shape in shapes.items():
        which = f"--incidence {incidence:g}: " if len(shapes) > 1 else ""
        onset = math.inf if arguments.allow_unsteady else onset_of(shape)
        solved = shape.differentiable() if arguments.gradient else shape
        for value in scene.reynolds:
            refined = scene.fidelity.for_body(value, shape.height, shape.nose).cells
            more = refined / scene.fidelity.cells
            with refusals_by_options(arguments.keep_size, which, more):
                check_reynolds(value, dimension, onset)
                fitted_domain(scene.stream, scene.fidelity, solved, value)
    return scene, cases


def _check_settling(arguments: argparse.Namespace) -> None:
    """Raise InvalidInput if an option goes without --particle."""
    others = (
        "reynolds",
        "chord_reynolds",
        "gradient",
        "allow_unsteady",
        "table",
        "plot",
        "out",
        "overwrite",
        "fluid",
    )
    given = [name for name in others if getattr(arguments, name)]
    given += ["reference"] if arguments.reference == CHORD else []
    given += ["moment-about"] if arguments.moment_about is not None else []
    if given:
        raise InvalidInput(f"--particle: goes without --{given[0].replace('_', '-')}")


def _settling(arguments: argparse.Namespace) -> JsonObject:
    """Report the terminal velocity of a particle, and its flow there."""
    particle = particle_of(arguments.particle)
    scene, shape = _scene(arguments, RANGE), shape_of(arguments, arguments.dimension)
    settled = settle(Flow(scene), shape, particle)
    held = shape.incidence
    row = Case(shape, held, settled.solution.reynolds).record | _row(settled.solution)
    row |= {"velocity": settled.velocity, "settling_reynolds": settled.reynolds}
    drag = settled.solution.drag * settled.solution.reynolds / settled.reynolds
    turns = turns_when_free(shape)
    row |= {"settling_cd": drag, "flows": settled.flows, "turns_when_free": turns}
    row["drift"] = settled.drift
    result = {"results": [row], "scene": _record(scene), "body": body_record(arguments)}
    verb = "falls" if particle.density_ratio > 1 else "rises"
    way = f"{held:g} degrees off" if held else "along"
    text = f"{particle_line(particle)}\n"
    text += f"{verb} {way} its axis at {settled.velocity:.4g} m/s, Re {settled.reynolds:.3g}, "
    text += f"Cd {drag:.5g} ({settled.flows} flow{'' if settled.flows == 1 else 's'})\n{_line(row)}"
    if turns:
        kept = f"drifting {settled.drift:.1f} degrees from the vertical" if held else "vertical"
        text += f"\nwith its axis held {kept}; a free body turns its broad side to its fall"
    return emit(result, arguments.json, text)


def turns_when_free(shape: FamilyShape) -> bool:
    """Return whether a 3-D body does not have its broad side to the stream, as it would if free."""
    upright = family_shape(dict(shape.parameters) | {INCIDENCE.name: 0.0}, dimension=3)
    return bool(shape.extent[0] > 1.01 * upright.extent.min())


def _scene(arguments: argparse.Namespace, reynolds: Sequence[float]) -> Scene:
    fidelity = read_fidelity(arguments.fidelity, arguments.dimension)
    if arguments.cells is not None:
        cells = whole_number("--cells", arguments.cells, 4, MOST_CELLS)
        fidelity = dataclasses.replace(fidelity, cells=cells)
    stream = parse_stream(arguments.stream)
    family = Family(dimension=arguments.dimension)
    return Scene(stream, (min(reynolds), max(reynolds)), family, fidelity)


def _record(scene: Scene) -> JsonObject:
    """Return the record of a scene without its family, of which the body needs not be."""
    return {name: value for name, value in scene.record.items() if name != "family"}


def _row(s: Solution) -> JsonObject:
    return {
        "cd": s.drag,
        "cd_extrapolated": s.extrapolated_drag,
        "cd_pressure": s.drag_pressure,
        "cd_friction": s.drag_friction,
        "cl": s.lift,
        "cm": s.moment,
        "glide": s.lift / s.drag,
        "converged": True,
        "cells": s.fidelity.cells,
        "iterations": s.newton_steps,
        "green_applications": s.green_applications,
        "wall_s": s.seconds,
        "gradient": s.gradients if s.gradients and len(s.gradients) > 1 else s.gradient,
        "expected_error": s.expected_error,
        "estimated_error": s.estimated_error,
        "estimated_lift_error": s.estimated_lift_error,
        "estimated_moment_error": s.estimated_moment_error,
        "sufficient": s.sufficient,
        "status": s.status,
        "accuracy": s.accuracy,
        "onset": s.onset,
    }


def _text(results: list[JsonObject]) -> str:
    """Return the results as text: a line for each if it is one or has a gradient, else a table."""
    found = [row for row in results if row["converged"]]
    if len(results) == 1 or all(row["gradient"] for row in found):
        text = "\n".join(map(_line, found))
    else:
        late = [row for row in found if row["reynolds"] > row["onset"]]
        forces = [forces_line(row) for row in found if row.get("forces_N")]
        text = "\n".join([text_table(results), *forces, *map(unsteady_remark, late)])
    return f"{reference_line(results[0])}\n{text}"


def _line(r: JsonObject) -> str:
    estimate, others = f"Cd {r['accuracy']}", ""
    for load, error in (("cl", r["estimated_lift_error"]), ("cm", r["estimated_moment_error"])):
        others += f"{load.capitalize()} {r[load]:.4f}"
        others += f" +- {error:.4f}  " if error else "  "
    others += moment_text(r)
    if r["cd_extrapolated"]:
        estimate += f", extrapolated Cd {r['cd_extrapolated']:.4f}"
    line = (
        f"Re {r['reynolds']:<8g} Cd {r['cd']:.4f} (pressure {r['cd_pressure']:.3f}, friction "
        f"{r['cd_friction']:.3f})  {others}{r['cells']} cells per D, {r['iterations']} Newton "
        f"steps, {r['green_applications']} convolutions, {r['wall_s']:.2f} s, {estimate}"
    )
    if r["reynolds"] > r["onset"]:
        line += f"\n  {unsteady_remark(r)}"
    if r.get("forces_N"):
        line += f"\n  {forces_line(r)}"
    for load, slopes in _by_load(r["gradient"]).items():
        values = (f"{name}: {value:+.5f}" for name, value in slopes.items())
        line += f"\n  d{load.capitalize()}/d" + "  ".join(values)
    return line


def _by_load(gradient: JsonObject | None) -> JsonObject:
    """Return derivatives by load; those of symmetric bodies are of the drag alone."""
    if gradient is None or "cd" in gradient:
        return gradient or {}
    return {"cd": gradient}


def _parser() -> Parser:
    parser = Parser(__doc__)
    add_body_arguments(parser)
    add_kept_arguments(parser)
    add = parser.add_argument
    add_reynolds_arguments(parser)
    add_reference_argument(parser)
    add_particle_argument(parser, "3-D: terminal velocity for ")
    add("--dimension", type=int, choices=(2, 3), default=2, help="2-D or 3-D flow (2)")
    add("--stream", default="unbounded", help="unbounded (default) or tunnel:H, H in D")
    add("--fidelity", default="standard", help="draft, standard (default) or fine")
    cells = f"cells per D, 4 to {MOST_CELLS}, instead of the fidelity's; thin boundary layers get "
    cells += "up to 3 times as many"
    add("--cells", type=int, help=cells)
    add(
        "--gradient",
        action="store_true",
        help="derivatives of Cd by parameters and Re; with camber or --incidence (0 too) those of "
        "Cd, Cl and Cm, also by the incidence in degrees if it is given; of the coefficients by "
        "the --reference length",
    )
    unsteady = "answer beyond the body's estimated onset of instability too (that of the cylinder "
    unsteady += "is at Re 47, that of the sphere at 210)"
    add("--allow-unsteady", action="store_true", help=unsteady)
    add_sweep_arguments(parser)
    return parser
