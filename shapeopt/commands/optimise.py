"""Shape of least drag, by a trained surrogate or directly by the flow's adjoint, verified.

python scripts/optimize_shape.py --surrogate pretrained --reynolds 40 --out out/re40
python scripts/optimize_shape.py --surrogate none --reynolds 40 --out out/direct40 --json
python scripts/optimize_shape.py --reynolds 1,10,40 --weights 1,2,1 --polish --out out/several
python scripts/optimize_shape.py --reynolds 20 --spread 0.3 --cvar 0.9 --out out/robust

Several Reynolds numbers: the weighted mean of Cd over the cylinder's Cd at that Re. With --spread
or --tolerance: the mean of Cd, or of its worst share with --cvar; cases outside the trained
range of Re are cut off. All cd_* are then values of that objective; "cases" lists the drags.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from common import Parser, command_line, emit, progress_bar, run
from problems import add_problem_arguments, problem_of, surrogate_of

from shapeopt.problem.objective import Robust, predicted_drags
from shapeopt.search.optimise import Optimum, optimise, optimise_directly
from shapeopt.problem.problem import Problem
from shapeopt.runs import RECORD, save_run
from shapeopt.search.verify import Verified, combined, cylinder_drags, verify_objective
from surrogate.body.family import PARAMETERS
from surrogate.errors import InvalidInput
from surrogate.files import check_target
from surrogate.model.store import Surrogate, scene_record


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, optimise, verify, save."""
    arguments = _parser().parse_args(argv)
    check_target(arguments.out, RECORD)
    surrogate = surrogate_of(arguments)
    if arguments.polish and surrogate is None:
        raise InvalidInput("--polish: belongs to a surrogate; --surrogate none is on the flow")
    problem = problem_of(arguments, surrogate)
    problem.candidates()  # refuses what cannot be met before any work is done
    with progress_bar("shape optimisation") as progress:
        progress(0.05, "searching")
        proposed = optimise(problem, surrogate) if surrogate else None
        optimum = proposed
        if proposed is None or arguments.polish:
            progress(0.2, "on the flow's adjoint")
            optimum = optimise_directly(problem, proposed and proposed.parameters)
        progress(0.5, f"{optimum.drag:.4f} after {optimum.calls} calls; verifying")
        cylinder = cylinder_drags(problem)
        found = verify_objective(problem, optimum.parameters, cylinder)
        progress(1.0, f"{found.value:.4f} verified")
    polished = optimum if proposed and arguments.polish else None
    searched = proposed or optimum
    result = {
        "parameters": dict(zip(PARAMETERS, optimum.parameters.tolist(), strict=True)),
        "reynolds": problem.objective.nominal,
        "cd_start": combined(cylinder, cylinder, problem),
        "cd_surrogate": proposed.drag if proposed else None,
        "cd_verified": found.value,
        "calls": searched.calls,
        "loop_s": searched.seconds,
        "verify_s": found.wall_s,
        "contour": str(Path(arguments.out) / "contour.csv"),
        "converged": optimum.converged,
        "objective": _objective(problem),
        "kkt_residual": optimum.kkt_residual,
        "edge_distance": _edge_distance(problem, optimum.parameters),
        "cases": _cases(problem, surrogate, optimum, found, cylinder),
    }
    if polished:
        result |= {
            "cd_before_polish": polished.start,
            "polish_calls": polished.calls,
            "polish_s": polished.seconds,
            "polish_green_applications": polished.green_applications,
        }
    if surrogate is None:
        result["cd_direct"] = optimum.drag
    record = {
        **result,
        "surrogate": arguments.surrogate,
        "scene": scene_record(problem.scene),
        "path": _path(proposed, polished, optimum).tolist(),
        "command": command_line(),
    }
    save_run(arguments.out, record, optimum.parameters)
    return emit(result, arguments.json, _text(result, problem, arguments.out))


def _path(proposed, polished, optimum):
    return np.concatenate([proposed.path, polished.path]) if polished else optimum.path


def _objective(problem: Problem) -> dict[str, Any]:
    """What was asked, as plain JSON."""
    objective = problem.objective
    plain = {"kind": type(objective).__name__, "number_of_cases": len(problem.scenarios.weight)}
    if isinstance(objective, Robust):
        plain |= {
            "spread": objective.spread.spread,
            "distribution": type(objective.spread).__name__,
            "tolerance": objective.tolerance,
            "cvar": objective.level,
            "seed": objective.seed,
            "kept": objective.kept(problem.scene),
        }
    return plain


def _edge_distance(problem: Problem, parameters: np.ndarray) -> float:
    """Least distance of a shape parameter to the edges of its trained range, over its width."""
    low, high = problem.scene.family.bounds.T
    return float(np.min(np.minimum(parameters - low, high - parameters) / (high - low)))


def _cases(
    problem: Problem,
    surrogate: Surrogate | None,
    optimum: Optimum,
    found: Verified,
    cylinder: np.ndarray,
) -> list[dict[str, Any]]:
    """Per case: body, Re, weight, and Cd of the cylinder, by the surrogate, by the flow."""
    scenarios = problem.scenarios
    guesses: list[float | None] = [None] * len(found.drags)
    if surrogate:
        drags, _ = predicted_drags(surrogate.network, optimum.parameters, scenarios)
        guesses = np.asarray(drags).tolist()
    return [
        {
            "parameters": (optimum.parameters + scenarios.shift[k]).tolist(),
            "reynolds": float(scenarios.reynolds[k]),
            "weight": float(scenarios.weight[k]),
            "cd_start": float(cylinder[k]),
            "cd_surrogate": guesses[k],
            "cd_verified": float(found.drags[k]),
        }
        for k in range(len(found.drags))
    ]


def _text(result, problem: Problem, out) -> str:
    gain = 100 * (1 - result["cd_verified"] / result["cd_start"])
    side = "below" if gain >= 0 else "above"
    shape = ", ".join(f"{name} {value:.4f}" for name, value in result["parameters"].items())
    relative = bool(problem.scenarios.relative)
    name = "Cd over the cylinder's" if relative else "Cd"
    lines = [
        f"Re {result['reynolds']:g}: {shape}",
        f"{name} {result['cd_verified']:.4f} verified, {abs(gain):.1f} % {side} the cylinder's "
        f"{result['cd_start']:.4f}; {result['calls']} calls in {result['loop_s']:.2f} s -> {out}",
    ]
    if "polish_calls" in result:
        lines.append(
            f"polished from {result['cd_before_polish']:.4f} by {result['polish_calls']} flows in "
            f"{result['polish_s']:.2f} s; KKT residual {result['kkt_residual']:.1e}"
        )
    if relative:
        lines += [
            f"  Re {case['reynolds']:g}: Cd {case['cd_verified']:.4f}, "
            f"the cylinder's {case['cd_start']:.4f}"
            for case in result["cases"]
        ]
    return "\n".join(lines)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    add_problem_arguments(parser)
    parser.add_argument("--polish", action="store_true", help="go on by the flow's adjoint")
    parser.add_argument("--out", required=True, help="folder of the run")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
