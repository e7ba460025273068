"""Shape of least drag, by a trained surrogate or by the flow's adjoint, verified by the flow.

python scripts/optimize_shape.py --surrogate pretrained --reynolds 40 --out out/re40
python scripts/optimize_shape.py --surrogate none --scene scripts/tunnel.toml --reynolds 40 \\
    --out out/flow
python scripts/optimize_shape.py --reynolds 40 --until flow --memory flows.json --out out/exact
python scripts/optimize_shape.py --reynolds 1,10,40 --weights 1,2,1 --until flow --out out/several
python scripts/optimize_shape.py --surrogate none --scene scripts/space.toml --reynolds 40 \\
    --max-thickness 0.5 --out out/flat
python scripts/optimize_shape.py --reynolds 20 --spread 0.3 --cvar 0.9 --out out/robust
python scripts/optimize_shape.py --surrogate pretrained:lift --reynolds 40 --objective glide \\
    --out out/glider
python scripts/optimize_shape.py --surrogate pretrained:lift --reynolds 40 --lift 0.3 \\
    --max-moment 0.1 --out out/vane
python scripts/optimize_shape.py --surrogate pretrained:lift --reynolds 40 --lift 0.2,0.5,0.8 \\
    --until flow --out out/multipoint
python scripts/optimize_shape.py --surrogate pretrained:lift --chord-reynolds 100 --lift 0.3 \\
    --min-thickness 0.3 --out out/section
python scripts/optimize_shape.py --surrogate pretrained:particle --objective settling \\
    --archimedes 1000 --range incidence=45:45 --until flow --out out/fast

The objective for several Reynolds numbers is the weighted mean of Cd over the cylinder's Cd at that
Re; with --spread or --tolerance it is the mean of Cd (of Cl / Cd for --objective glide) over the
uncertain cases, with --cvar over the worst of them, and the spread of Re is truncated to the
scene's range. All cd_* are then values of that objective (for glide those of the body itself at the
nominal Re, the ratio being under "glide"), and "cases" lists the drags. With several lifts it is
the weighted mean of Cd of one section over them, each at an incidence of its own, which "cases"
lists too. Sections with camber and incidence may have bounds on Cl and Cm, and the glide ratio Cl /
Cd as the objective; with --chord-reynolds bodies of one chord are compared, and coefficients and
the lengths of bounds are by it. Of particles the terminal velocity is the greatest where sqrt(Cd^2
+ Cl^2) is the least at the Re where it balances weight.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.distributed import add_device_argument, use_devices
from shapeopt.commands.particle import particle_line, particle_of
from shapeopt.commands.problem_arguments import (
    add_problem_arguments,
    add_search_arguments,
    ends_on_flow,
    problem_of,
    surrogate_of,
)
from shapeopt.commands.reference import unsteady_remark
from shapeopt.problem.conflicts import candidates
from shapeopt.problem.problem import Problem
from shapeopt.runs import check_run_folder, save_run
from shapeopt.search.design import Design, multiplier_words
from shapeopt.search.designer import Designer
from shapeopt.search.optimise import optimise
from shapeopt.stored import design_settings, stored_run
from surrogate.body.parameters import INCIDENCE
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject, target_of
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate
from surrogate.progress import print_message, progress_bar

HIDDEN = ("scene", "path", "command", "settings", "files_sha256")


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, optimise the shape, verify the optimum by the flow and save the run."""
    arguments = _parser().parse_args(argv)
    devices = use_devices(arguments.devices)
    check_run_folder(arguments.out)
    surrogate = surrogate_of(arguments)
    on_flow = ends_on_flow(arguments, surrogate)
    if arguments.memory and _within(arguments.memory, arguments.out):
        raise InvalidInput("--memory: is in the folder --out; choose a file outside it")
    if devices is not None and not on_flow:
        raise InvalidInput("--devices: goes with --until flow or --surrogate none")
    problem = problem_of(arguments, surrogate)
    if devices not in (None, 1) and len(problem.scenarios.weight) == 1:
        words = "the cases of an objective are spread over devices, and this one has a single case"
        raise InvalidInput(f"--devices: {words}")
    settings = design_settings(problem, surrogate, on_flow, arguments.memory)
    record = stored_run(arguments.out, settings, arguments.overwrite)
    if record is not None:
        said = "this design is done already; --overwrite repeats it"
        print_message(f"{arguments.out}: {said}")
    else:
        design = _design(arguments, problem, surrogate, on_flow, devices)
        record = save_run(arguments.out, design, surrogate, arguments.surrogate, settings=settings)
    result = {key: value for key, value in record.items() if key not in HIDDEN}
    result["warning"], text = surrogate and surrogate.inaccuracy, []
    if arguments.particle is not None:
        particle = particle_of(arguments.particle)
        result["velocity"] = particle.velocity(record["reynolds"])
        text = [f"  {particle_line(particle)}: {result['velocity']:.4g} m/s along its path"]
    return emit(result, arguments.json, "\n".join([_text(record, problem, arguments.out), *text]))


def _design(
    arguments: argparse.Namespace,
    problem: Problem,
    surrogate: Surrogate | None,
    on_flow: bool,
    devices: int | None,
) -> Design:
    """Search and verify, with progress."""
    candidates(problem)  # raises InvalidInput where the constraints contradict each other
    model = surrogate or Flow(problem.scene)
    if on_flow:
        designer = Designer(model, arguments.memory, devices)
        print_message(problem.scene.explain())
    with progress_bar("shape optimisation") as progress:
        progress(0.05, "searching")
        if on_flow:

            def report(body, flows):
                state = f"{flows} flows: {_objective(problem, body.value)}, "
                state += f"KKT residual {body.kkt_residual:.1e}"
                progress(0.5 - 0.45 / (1 + flows / 8), state)

            design = designer.design(problem, report)
        else:
            design = optimise(problem, model)
        body = ", ".join(f"{name} {x:.4f}" for name, x in _named(design).items())
        progress(0.5, f"{_objective(problem, design.objective)} of {body}; solving the flow")
        verified = design.verified
        progress(1.0, f"{_objective(problem, verified.objective)} verified")
    return design


def _named(design: Design) -> dict[str, float]:
    return design.problem.scene.family.named(design.parameters)


def _objective(problem: Problem, value: float) -> str:
    """Return the value of the objective in words, of glide the ratio that is maximised."""
    if bool(problem.scenarios.glide):
        return f"{_ratio(problem)} {-value:.4f}"
    return f"objective {value:.4f}"


def _ratio(problem: Problem) -> str:
    """Return the name of the ratio that is maximised for a glide."""
    count = len(problem.scenarios.weight)
    return "glide ratio" if count == 1 else f"mean glide ratio of {_worst(problem)}{count} cases"


def _worst(problem: Problem) -> str:
    """Say of which part of the cases the objective is the mean; empty if of all."""
    level = float(problem.scenarios.level)
    return f"the worst {100 * (1 - level):g} % of " * (level > 0)


def _within(file: str, folder: str) -> bool:
    return target_of(folder) in target_of(file).parents


def _text(r: JsonObject, problem: Problem, out: str) -> str:
    """Return the result as text for a person."""
    lifting = problem.scene.family.has_lift
    shape = ", ".join(f"{name} {value:.4f}" for name, value in r["parameters"].items())
    relative, round_body = bool(problem.scenarios.relative), problem.scene.family.round_body
    name = f"Cd over the {round_body}'s" if relative else "Cd"
    if len(r["cases"]) > 1 and not relative and "glide" not in r:
        over = "lifts" if problem.objective.lifts else "cases"
        name = f"mean Cd of {_worst(problem)}{len(r['cases'])} {over}"
    lifts, unit = "", problem.reference.symbol
    first = f" at lift {problem.objective.lifts[0]:g}" if problem.objective.lifts else ""
    if lifting and r["cl_verified"] is not None:
        planar = problem.scene.dimension == 2
        about = f"over {unit} and {unit}^2, " * planar + "Cm about the centroid"
        lifts = f"; Cl {r['cl_verified']:.4f}, Cm {r['cm_verified']:.4f} verified, {about}"
    if "glide" in r:
        lifts += f", {_ratio(problem)} {r['glide']:.4f}"
    if archimedes := r["objective"].get("archimedes"):
        lifts += f"; none settles faster at Archimedes number {archimedes:g}"
    several = len(r["cases"]) > 1
    cd = "unknown" if r["cd_verified"] is None else f"{r['cd_verified']:.4f}"
    cd += " at the nominal Re, its cases" * ("glide" in r and several)
    grid = f" on {r['cells']} cells per D"
    relative_drag = "" if lifting else _relative_drag(r, round_body, relative)
    numbers = [case["reynolds"] for case in r["cases"]] if relative else [r["reynolds"]]
    at = ", ".join(f"{reynolds:g}" for reynolds in numbers)
    at = f"Re {at}"
    if problem.by_chord:
        at, name = f"chord Re {r['chord_reynolds']:g}, U D / nu {r['reynolds']:.4g}", "Cd over c"
        ratios = [f"{r[key] / r['chord']:.1%} {key}" for key in ("thickness", "camber") if key in r]
        shape += f", {', '.join(ratios)}"
    lines = [
        f"{at}{first}: {shape}, chord {r['chord']:.4f} D{lifts}",
        f"{name} {cd} verified{grid}, {r['accuracy']}; "
        f"{relative_drag}{r['calls']} calls and {r['flows']} flows in {r['loop_s']:.2f} s, "
        f"KKT residual {r['kkt_residual']:.0e} -> {out}",
    ]
    lines += bound_lines(r, problem)
    if turned := r["parameters"].get(INCIDENCE.name):
        planar = problem.scene.dimension == 2
        files = "contour.csv and body.stl" if planar else "contour.csv"
        solved = "; solve_drag.py --contour takes --incidence" if planar else ""
        words = f"at incidence 0, to be turned nose up by {turned:.4g} degrees{first}"
        lines.append(f"  {files}: {words}{solved}")
    if late := [case for case in r["cases"] if case["reynolds"] > case["onset"]]:
        lines.append(f"  {unsteady_remark(late[0])}")
    if ends := r["at_range_ends"]:
        wider = "surrogates and scenes of wider ranges may have better"
        lines.append(f"  at the end of its range: {', '.join(ends)}; {wider}")
    if slopes := r["multipliers"]:
        at = "" if problem.objective.fixed else ", at this Re"
        lines.append(
            f"  by the {r['until']}{at}: {': '.join(multiplier_words(slopes, 'glide' in r))}"
        )
    if relative:
        lines += [
            f"  Re {case['reynolds']:g}: Cd {case['cd_verified']:.4f}, "
            f"the {round_body}'s {case['cd_start']:.4f}"
            for case in r["cases"]
        ]
    return "\n".join(lines)


def bound_lines(r: JsonObject, problem: Problem) -> list[str]:
    """Return lines on the loads of the cases, and on bounds that are violated."""
    lines, cases = [], [case for case in r["cases"] if case["cl_verified"] is not None]
    if problem.objective.lifts:
        rows = zip(problem.objective.lifts, cases, strict=True)
        return [*(_lift_line(problem, *row) for row in rows), *_violated_lines(r, problem)]
    if len(cases) > 1 and problem.scene.family.has_lift:
        lifts, moments = ([case[f"{name}_verified"] for case in cases] for name in ("cl", "cm"))
        lines.append(
            f"  in the {len(cases)} cases: Cl {min(lifts):.4f} to {max(lifts):.4f}, "
            f"Cm {min(moments):.4f} to {max(moments):.4f}; those of the first line are nominal"
        )
    return lines + _violated_lines(r, problem)


def _lift_line(problem: Problem, lift: float, case: JsonObject) -> str:
    """Return the line on the flow at one of several lifts."""
    incidence = problem.scene.family.named(np.array(case["parameters"]))[INCIDENCE.name]
    loads = (f"{load.capitalize()} {case[f'{load}_verified']:.4f}" for load in ("cd", "cl", "cm"))
    return f"  lift {lift:g}: incidence {incidence:.4g}, {', '.join(loads)}, {case['status']}"


def _violated_lines(r: JsonObject, problem: Problem) -> list[str]:
    led = r["until"] != "flow"
    remedy = "; --until flow searches for a body that meets it" if led else ""
    return [
        f"  {problem.bound_text(name)} is not met: {load:.4f} by the flow{remedy}"
        for name, load in r["violated"].items()
    ]


def _relative_drag(r: JsonObject, round_body: str, relative: bool) -> str:
    """Return the drag against that of the cylinder or sphere as text; empty if not known."""
    if r["cd_start"] is None:
        return ""
    gain = 100 * (1 - r["cd_verified"] / r["cd_start"])
    side = "below" if gain >= 0 else "above"
    whose = round_body if relative else f"{round_body}'s {r['cd_start']:.4f}"
    return f"{abs(gain):.1f} % {side} the {whose}; "


def _parser() -> Parser:
    parser = Parser(__doc__)
    add_problem_arguments(parser)
    add_search_arguments(parser)
    parser.add_argument("--out", required=True, help="folder of the run")
    parser.add_argument("--overwrite", action="store_true", help="replace a run that is there")
    add_device_argument(parser, "for several cases with --until flow or --surrogate none: ")
    return parser
