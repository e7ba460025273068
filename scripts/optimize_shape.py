"""Shape of least drag, by a trained surrogate or directly by the flow's adjoint, verified.

python scripts/optimize_shape.py --surrogate pretrained --reynolds 40 --out out/re40
python scripts/optimize_shape.py --surrogate none --reynolds 40 --out out/direct40 --json
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from common import Parser, command_line, emit, fidelity_of, progress_bar, reynolds_numbers, run

from shapeopt.optimise import Optimum, optimise, optimise_directly
from shapeopt.problem import Problem
from shapeopt.runs import RECORD, save_run
from shapeopt.verify import CYLINDER, verify
from surrogate.body import PARAMETERS
from surrogate.errors import InvalidInput
from surrogate.files import check_target
from surrogate.scene import Scene
from surrogate.store import load_surrogate, scene_record


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, optimise, verify, save."""
    arguments = _parser().parse_args(argv)
    reynolds = reynolds_numbers(arguments.reynolds)
    if len(reynolds) != 1:
        raise InvalidInput("--reynolds: one number; run once for each")
    check_target(arguments.out, RECORD)
    surrogate = None if arguments.surrogate == "none" else load_surrogate(arguments.surrogate)
    if surrogate and arguments.fidelity:
        raise InvalidInput("--fidelity: belongs to --surrogate none; a surrogate has its scene's")
    fidelity = fidelity_of(arguments.fidelity or "standard")
    scene = surrogate.scene if surrogate else Scene(fidelity=fidelity)
    problem = Problem(scene, reynolds[0], arguments.max_length, arguments.min_thickness)
    problem.candidates()  # refuses what cannot be met before any work is done
    with progress_bar("shape optimisation") as progress:
        progress(0.05, "searching")
        optimum = optimise(problem, surrogate) if surrogate else optimise_directly(problem)
        progress(0.5, f"Cd {optimum.drag:.4f} after {optimum.calls} calls; verifying")
        found = verify(scene, optimum.parameters, problem.reynolds)
        start = verify(scene, CYLINDER, problem.reynolds)
        progress(1.0, f"Cd {found.cd:.4f} verified")
    result = {
        "parameters": dict(zip(PARAMETERS, optimum.parameters.tolist(), strict=True)),
        "reynolds": problem.reynolds,
        "cd_start": start.cd,
        "cd_surrogate": optimum.drag if surrogate else None,
        "cd_verified": found.cd,
        "calls": optimum.calls,
        "loop_s": optimum.seconds,
        "verify_s": found.wall_s,
        "contour": str(Path(arguments.out) / "contour.csv"),
        "converged": optimum.converged and found.converged,
    }
    if surrogate is None:
        result["cd_direct"] = optimum.drag
    save_run(arguments.out, _record(result, arguments, scene, optimum), optimum.parameters)
    return emit(result, arguments.json, _text(result, arguments.out))


def _record(result, arguments, scene: Scene, optimum: Optimum) -> dict[str, Any]:
    return {
        **result,
        "surrogate": arguments.surrogate,
        "scene": scene_record(scene),
        "path": optimum.path.tolist(),
        "command": command_line(),
    }


def _text(result, out) -> str:
    gain = 100 * (1 - result["cd_verified"] / result["cd_start"])
    shape = ", ".join(f"{name} {value:.4f}" for name, value in result["parameters"].items())
    return (
        f"Re {result['reynolds']:g}: {shape}\n"
        f"Cd {result['cd_verified']:.4f} verified, {gain:.1f} % below the cylinder's "
        f"{result['cd_start']:.4f}; {result['calls']} calls in {result['loop_s']:.2f} s -> {out}"
    )


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--surrogate", default="pretrained", help="a folder, pretrained, or none")
    parser.add_argument("--reynolds", required=True, help="U D / nu")
    parser.add_argument("--max-length", type=float, help="longest chord, in D")
    parser.add_argument("--min-thickness", type=float, help="least greatest thickness, in D")
    parser.add_argument("--fidelity", help="draft, standard or fine, with --surrogate none")
    parser.add_argument("--out", required=True, help="folder of the run")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
