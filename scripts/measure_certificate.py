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

from surrogate.certificate import ENOUGH, SETTLED, reduced_correction
from surrogate.errors import InvalidInput
from surrogate.files import check_folder, whole_file
from surrogate.reduced import load_reduced
from surrogate.store import load_surrogate
from surrogate.training.physics import (
    draw_samples,
    require_converged,
    scene_domain,
    solve_labels,
)

CHANGES = (1e-3, 1e-4, ENOUGH)  # of the drag in a sweep, at which to stop
SURROGATES = [f"pretrained:{method}" for method in ("sip", "supervised", "hig", "dp")]


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Certify every held-out body by every variant."""
    arguments = _parser().parse_args(argv)
    if not 1 <= arguments.bodies <= 10000:
        raise InvalidInput(f"--bodies {arguments.bodies}: from 1 to 10000")
    check_folder(arguments.out)
    flows = load_reduced() if arguments.flows is None else load_reduced(arguments.flows)
    surrogates = {name: load_surrogate(name) for name in arguments.surrogates}
    for name, surrogate in surrogates.items():
        if surrogate.scene != flows.scene:
            raise InvalidInput(f"{name}: of another scene than the reduced flows")
    domain = scene_domain(flows.scene)
    held_out = jax.random.split(jax.random.key(arguments.seed), 3)[1]
    samples = draw_samples(flows.scene, held_out, arguments.bodies)
    guess = flows.guess(samples)
    rows = []
    with progress_bar("certificates") as progress:
        progress(0.0, f"solving {arguments.bodies} bodies")
        labels = require_converged(solve_labels(domain, samples))
        for k, (name, surrogate) in enumerate(surrogates.items()):
            for enough in CHANGES:
                check = functools.partial(_check, domain, surrogate.network, enough)
                rows.append(
                    {"surrogate": name, "enough": enough} | _measure(check, samples, guess, labels)
                )
            progress((k + 1) / len(surrogates), name)
    with whole_file(Path(arguments.out) / "certificate.json") as part:
        part.write_text(json.dumps(rows, indent=1) + "\n")
    return emit({"rows": rows}, arguments.json, _text(rows))


def _check(domain, network, enough, body, fields):
    return reduced_correction(domain, network, fields, *body, enough)


def _measure(check, samples, guess, labels) -> dict[str, Any]:
    checks = jax.tree.map(
        np.asarray, jax.jit(lambda *both: jax.lax.map(lambda x: check(*x), both))(samples, guess)
    )
    truth, work = -2 * np.asarray(labels.amplitude[:, 0]), float(np.mean(labels.products))
    before, after = (np.abs(cd / truth - 1) for cd in (checks.predicted, checks.corrected))
    spent = float(np.mean(checks.products))
    return {
        "before_mean": float(before.mean()),
        "before_max": float(before.max()),
        "after_mean": float(after.mean()),
        "after_max": float(after.max()),
        "green_applications": spent,
        "share_of_body_flow": spent / work,
        "unsettled": float(np.mean(~(checks.remaining <= SETTLED))),
    }


def _text(rows: list[dict[str, Any]]) -> str:
    heads = [
        "surrogate",
        "swept until",
        "error before",
        "error after",
        "G",
        "of a body flow",
        "solved",
    ]
    lines = [
        [
            r["surrogate"].removeprefix("pretrained:"),
            f"{100 * r['enough']:g} %",
            f"{100 * r['before_mean']:.3f} (max {100 * r['before_max']:.2f}) %",
            f"{100 * r['after_mean']:.4f} (max {100 * r['after_max']:.3f}) %",
            f"{r['green_applications']:.1f}",
            f"{100 * r['share_of_body_flow']:.0f} %",
            f"{100 * r['unsettled']:.0f} %",
        ]
        for r in rows
    ]
    return markdown(heads, lines)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--surrogates", nargs="+", default=SURROGATES, help="folders")
    parser.add_argument("--flows", help="reduced flows by reduce_flow.py; those that ship")
    parser.add_argument("--bodies", type=int, default=512, help="held-out bodies")
    parser.add_argument("--seed", type=int, default=0, help="of these bodies, as in a training")
    parser.add_argument("--out", required=True, help="folder of certificate.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
