"""Drag of a family body by a trained surrogate, with --verify also by the flow solver.

python scripts/predict_drag.py --surrogate pretrained --aspect 2 --reynolds 1,10,40
python scripts/predict_drag.py --surrogate out/sip --aspect 2 --beta2 0.1 --reynolds 20 --verify
python scripts/predict_drag.py --aspect 4 --chord-reynolds 2:60:log20 --reference chord --json
python scripts/predict_drag.py --aspect 6 --reynolds 45 --extrapolate --verify
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from shapeopt.commands.arguments import add_family_arguments, family_named
from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.sections import (
    CHORD,
    add_reference_argument,
    add_reynolds_arguments,
    check_reference,
    reference_line,
    reference_record,
    reynolds_of,
)
from surrogate.body.shape import family_shape
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject
from surrogate.flow.flow import Flow
from surrogate.model.store import load
from surrogate.model.surrogate import Surrogate


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, predict, report."""
    arguments = _parser().parse_args(argv)
    if arguments.aspect is None:
        raise InvalidInput("body: --aspect is needed")
    surrogate, named = load(arguments.surrogate), family_named(arguments)
    dimension = surrogate.scene.dimension
    check_reference(arguments.reference, dimension)
    chord = family_shape(named, dimension=dimension).chord  # refuses what is no body
    reynolds = reynolds_of(arguments, chord, dimension)
    parameters = surrogate.scene.family.parameters(named)
    at = arguments.reference, arguments.extrapolate
    results = [_predict(surrogate, parameters, re, *at) for re in reynolds]
    if arguments.verify:
        for row in results:
            row |= _verify(surrogate, parameters, row)
    result = {
        "results": results,
        "surrogate": arguments.surrogate,
        "method": surrogate.recorded("method"),
        "warning": surrogate.inaccuracy,
        "drag_error_mean": surrogate.recorded("drag_error_mean"),
        "parameters": surrogate.scene.family.named(parameters),
    }
    return emit(
        result, arguments.json, "\n".join([reference_line(results[0]), *map(_line, results)])
    )


def _predict(
    surrogate: Surrogate,
    parameters: np.ndarray,
    reynolds: float,
    reference: str,
    extrapolate: bool,
) -> JsonObject:
    length = surrogate.scene.family.body_class.length

    def drag(body):
        by = length(body) if reference == CHORD else 1.0
        return surrogate.drag(body, reynolds, extrapolate) / by

    cd, gradient = drag(parameters), jax.grad(drag)(jnp.asarray(parameters))
    beyond = surrogate.beyond(parameters, reynolds)
    confidence = "inside"
    if beyond:
        worst = max(beyond, key=lambda name: beyond[name])
        confidence = f"outside: {worst} by {beyond[worst]:.2g} of its trained range"
    return {
        **reference_record(reynolds, float(length(parameters)), reference),
        "cd": float(cd),
        "gradient": surrogate.scene.family.named(gradient),
        "in_trained_range": not beyond,
        "confidence": confidence,
    }


def _verify(surrogate: Surrogate, parameters: np.ndarray, row: JsonObject) -> JsonObject:
    """Solve the flow: on the scene's grid inside the trained ranges, else on one for the body."""
    scene, body = surrogate.scene, parameters
    if not row["in_trained_range"]:
        body = family_shape(scene.family.named(parameters), dimension=scene.dimension)
    solution = Flow(scene).solve(body, row["reynolds"], allow_unsteady=True)
    drag = solution.drag / (row["chord"] if row["reference"] == CHORD else 1.0)
    return {
        "cd_flow": drag,
        "error": abs(row["cd"] / drag - 1),
        "status": solution.status,
        "accuracy": solution.accuracy,
        "expected_error": solution.expected_error,
        "estimated_error": solution.estimated_error,
    }


def _line(r: JsonObject) -> str:
    line = f"Re {r['reynolds']:<8g} Cd {r['cd']:.4f}"
    if "cd_flow" in r:
        line += f"  by the flow {r['cd_flow']:.4f}, which {r['accuracy']}"
        line += f", error {100 * r['error']:.3f} %"
    return line + ("" if r["in_trained_range"] else f"  ({r['confidence']})")


def _parser() -> Parser:
    parser = Parser(__doc__)
    parser.add_argument("--surrogate", default="pretrained", help="folder, or pretrained[:METHOD]")
    add_family_arguments(parser)
    add_reynolds_arguments(parser)
    add_reference_argument(parser)
    beyond = "answer outside the trained ranges too"
    parser.add_argument("--extrapolate", action="store_true", help=beyond)
    parser.add_argument("--verify", action="store_true", help="solve the flow too, and compare")
    return parser
