"""What a certificate costs and gains on held-out bodies, for one surrogate or several.

python scripts/measure_certificate.py --out out/certificate
"""

import functools
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from common import Parser, emit, markdown, progress_bar, run

from surrogate.certificate import reduced_correction, solved_correction
from surrogate.errors import InvalidInput
from surrogate.files import whole_file
from surrogate.reduced import load_reduced
from surrogate.store import load_surrogate
from surrogate.training.physics import (
    draw_samples,
    require_converged,
    scene_domain,
    solve_labels,
)

SWEEPS = (2, 3, 4)
SURROGATES = [f"pretrained:{method}" for method in ("sip", "supervised", "hig", "dp")]


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Certify every held-out body by every variant."""
    arguments = _parser().parse_args(argv)
    if not 1 <= arguments.bodies <= 10000:
        raise InvalidInput(f"--bodies {arguments.bodies}: from 1 to 10000")
    flows = load_reduced() if arguments.flows is None else load_reduced(arguments.flows)
    rows = []
    with progress_bar("certificates") as progress:
        for k, name in enumerate(arguments.surrogates):
            surrogate = load_surrogate(name)
            if surrogate.scene != flows.scene:
                raise InvalidInput(f"{name}: of another scene than the reduced flows")
            domain, network = scene_domain(surrogate.scene), surrogate.network
            held_out = jax.random.split(jax.random.key(surrogate.record["seed"]), 3)[1]
            samples = draw_samples(surrogate.scene, held_out, arguments.bodies)
            progress(k / len(arguments.surrogates), f"{name}, {arguments.bodies} bodies")
            labels = require_converged(solve_labels(domain, samples))
            guess = flows.guess(samples)
            flow = functools.partial(_by_body_flow, domain, network)
            checks = {"body flow, loose": flow} | {
                f"reduced flow, {sweeps} sweeps": functools.partial(
                    _by_reduced_flow, domain, network, sweeps
                )
                for sweeps in SWEEPS
            }
            rows += [
                {"surrogate": name, "certificate": title} | _measure(check, samples, guess, labels)
                for title, check in checks.items()
            ]
        progress(1.0)
    with whole_file(Path(arguments.out) / "certificate.json") as part:
        part.write_text(json.dumps(rows, indent=1) + "\n")
    return emit({"rows": rows}, arguments.json, _text(rows))


def _by_reduced_flow(domain, network, sweeps, body, fields):
    return reduced_correction(domain, network, fields, *body, sweeps)


def _by_body_flow(domain, network, body, _):
    return solved_correction(domain, network, *body)


def _measure(check, samples, guess, labels) -> dict[str, Any]:
    checks = jax.tree.map(
        np.asarray, jax.jit(lambda *both: jax.lax.map(lambda x: check(*x), both))(samples, guess)
    )
    truth, work = -2 * np.asarray(labels.amplitude[:, 0]), float(np.mean(labels.products))
    found = checks.converged
    before = np.abs(checks.predicted / truth - 1)[found]
    after = np.abs(checks.corrected / truth - 1)[found]
    spent = float(np.mean(checks.products))
    return {
        "before_mean": float(before.mean()),
        "before_max": float(before.max()),
        "after_mean": float(after.mean()),
        "after_max": float(after.max()),
        "green_applications": spent,
        "share_of_body_flow": spent / work,
        "remaining_mean": float(checks.remaining[found].mean()),
        "not_found": int(np.sum(~found)),
    }


def _text(rows: list[dict[str, Any]]) -> str:
    heads = ["surrogate", "certificate", "error before", "error after", "G", "of a body flow"]
    lines = [
        [
            r["surrogate"].removeprefix("pretrained:"),
            r["certificate"],
            f"{100 * r['before_mean']:.3f} (max {100 * r['before_max']:.2f}) %",
            f"{100 * r['after_mean']:.4f} (max {100 * r['after_max']:.3f}) %",
            f"{r['green_applications']:.1f}",
            f"{100 * r['share_of_body_flow']:.0f} %",
        ]
        for r in rows
    ]
    return markdown(heads, lines)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--surrogates", nargs="+", default=SURROGATES, help="folders")
    parser.add_argument("--flows", help="reduced flows by reduce_flow.py; those that ship")
    parser.add_argument("--bodies", type=int, default=128, help="held-out bodies")
    parser.add_argument("--out", required=True, help="folder of certificate.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
