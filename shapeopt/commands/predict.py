"""Drag of a family body by a trained surrogate; --certify checks it against the flow.

python scripts/predict_drag.py --surrogate pretrained --aspect 2 --reynolds 1,10,40
python scripts/predict_drag.py --surrogate out/sip --aspect 2 --beta2 0.1 --reynolds 20 --certify
python scripts/predict_drag.py --surrogate out/sip --certify --flows out/flows.npz --aspect 2 \
    --reynolds 20
"""

import argparse
import sys
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from common import Parser, add_family_arguments, emit, family_parameters, reynolds_numbers, run

from surrogate.body.family import PARAMETERS, check_family
from surrogate.certificate import certify
from surrogate.errors import InvalidInput
from surrogate.reduced import ReducedFlow, load_reduced
from surrogate.model.store import Surrogate, load_surrogate


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, predict, report."""
    arguments = _parser().parse_args(argv)
    if arguments.aspect is None:
        raise InvalidInput("body: --aspect is needed")
    reynolds = reynolds_numbers(arguments.reynolds)
    parameters = np.array(family_parameters(arguments))
    check_family(parameters)
    surrogate = load_surrogate(arguments.surrogate)
    if arguments.flows and arguments.certify != "quick":
        raise InvalidInput("--flows: is for --certify quick")
    flows = _flows(arguments, surrogate) if arguments.certify == "quick" else None
    results = [_predict(surrogate, parameters, value) for value in reynolds]
    if arguments.certify:
        for row in results:
            row |= certify(surrogate, parameters, row["reynolds"], flows)._asdict()
    result = {
        "results": results,
        "surrogate": arguments.surrogate,
        "method": surrogate.recorded("method"),
        "drag_error_mean": surrogate.recorded("drag_error_mean"),
        "parameters": dict(zip(PARAMETERS, parameters.tolist(), strict=True)),
    }
    return emit(result, arguments.json, "\n".join(map(_line, results)))


def _flows(arguments: argparse.Namespace, surrogate: Surrogate) -> ReducedFlow | None:
    """The reduced flows asked for; else those that ship, if they are of the surrogate's scene."""
    path = arguments.flows
    flows = load_reduced() if path is None else load_reduced(path)
    if flows.scene == surrogate.scene:
        return flows
    if path is not None:
        raise InvalidInput(f"--flows {path}: of another scene than {arguments.surrogate}")
    return None


def _predict(surrogate: Surrogate, parameters, reynolds: float) -> dict[str, Any]:
    body, re = jnp.asarray(parameters), jnp.asarray(reynolds, float)
    cd, gradient = jax.value_and_grad(surrogate.drag)(body, re)
    known = surrogate.knows(parameters, reynolds)
    return {
        "reynolds": reynolds,
        "cd": float(cd),
        "gradient": dict(zip(PARAMETERS, gradient.tolist(), strict=True)),
        "in_trained_range": known,
        "confidence": _confidence(surrogate.beyond(parameters, reynolds)),
    }


def _confidence(beyond: dict[str, float]) -> str:
    if not beyond:
        return "inside"
    worst = max(beyond, key=lambda name: beyond[name])
    return f"outside: {worst} by {beyond[worst]:.2g} of its trained range"


def _line(r: dict[str, Any]) -> str:
    line = f"Re {r['reynolds']:<8g} Cd {r['cd']:.4f}"
    if "cd_corrected" in r:
        line += (
            f"  corrected {r['cd_corrected']:.4f}  estimated error "
            f"{100 * r['estimated_error']:.3f} %  by {r['by']}, "
            f"{r['certificate_green_applications']} applications of G"
        )
    return line + ("" if r["in_trained_range"] else f"  ({r['confidence']})")


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--surrogate", default="pretrained", help="a folder, or pretrained")
    add_family_arguments(parser)
    parser.add_argument("--reynolds", required=True, help="one or several: 1,10,40")
    parser.add_argument(
        "--certify",
        nargs="?",
        const="quick",
        choices=["quick", "thorough"],
        help="correct by the flow equations: quick (default) by reduced flows where there are any "
        "and they suffice, thorough by a body flow",
    )
    parser.add_argument("--flows", help="reduced flows by reduce_flow.py; those that ship")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
