"""What a certificate costs and gains on held-out bodies, for one surrogate or several.

python scripts/measure_certificate.py --surrogates pretrained --out out/certificate
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from common import Parser, emit, markdown, progress_bar, run

from surrogate.certificate import QUICK, THOROUGH, Thoroughness, correction
from surrogate.errors import InvalidInput
from surrogate.files import whole_file
from surrogate.flow.newton import NewtonSettings
from surrogate.store import load_surrogate
from surrogate.training.physics import (
    draw_samples,
    require_converged,
    scene_domain,
    solve_labels,
)


def _loose(tolerance: float) -> NewtonSettings:
    return NewtonSettings(tolerance, 10, 40, forcing=0.5)


VARIANTS = {
    "1 harmonic, to 1e-3": Thoroughness(1, _loose(1e-3)),
    "2 harmonics, to 1e-2": Thoroughness(2, _loose(1e-2)),
    "2 harmonics, to 1e-3 (quick)": QUICK,
    "2 harmonics, to 1e-4": Thoroughness(2, _loose(1e-4)),
    "4 harmonics, to 1e-4": Thoroughness(4, _loose(1e-4)),
    "all modes, to 1e-3": Thoroughness(None, _loose(1e-3)),
    "all modes, to 1e-4 (thorough)": THOROUGH,
}


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Certify every held-out body by every variant."""
    arguments = _parser().parse_args(argv)
    if not 1 <= arguments.bodies <= 10000:
        raise InvalidInput(f"--bodies {arguments.bodies}: from 1 to 10000")
    rows = []
    with progress_bar("certificates") as progress:
        for name in arguments.surrogates:
            surrogate = load_surrogate(name)
            domain, network = scene_domain(surrogate.scene), surrogate.network
            held_out = jax.random.split(jax.random.key(surrogate.record["seed"]), 3)[1]
            samples = draw_samples(surrogate.scene, held_out, arguments.bodies)
            progress(0.0, f"{name}: solving {arguments.bodies} bodies")
            labels = require_converged(solve_labels(domain, samples))
            truth = -2 * np.asarray(labels.amplitude[:, 0])
            work = float(np.mean(labels.products))
            for k, (variant, thoroughness) in enumerate(VARIANTS.items()):
                rows.append(
                    {"surrogate": name, "variant": variant}
                    | _measure(domain, network, samples, truth, work, thoroughness)
                )
                progress((k + 1) / len(VARIANTS), variant)
    with whole_file(Path(arguments.out) / "certificate.json") as part:
        part.write_text(json.dumps(rows, indent=1) + "\n")
    return emit({"rows": rows}, arguments.json, _text(rows))


def _measure(domain, network, samples, truth, work, thoroughness) -> dict[str, Any]:
    def one(sample):
        return correction(domain, network, *sample, thoroughness)

    checks = jax.tree.map(np.asarray, jax.jit(lambda s: jax.lax.map(one, s))(samples))
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
        "not_found": int(np.sum(~found)),
    }


def _text(rows: list[dict[str, Any]]) -> str:
    heads = ["surrogate", "certificate", "error before", "error after", "G", "of a body flow"]
    lines = [
        [
            Path(r["surrogate"]).name,
            r["variant"],
            f"{100 * r['before_mean']:.3f} (max {100 * r['before_max']:.2f}) %",
            f"{100 * r['after_mean']:.3f} (max {100 * r['after_max']:.2f}) %",
            f"{r['green_applications']:.1f}",
            f"{100 * r['share_of_body_flow']:.0f} %",
        ]
        for r in rows
    ]
    return markdown(heads, lines)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--surrogates", nargs="+", default=["pretrained"], help="folders")
    parser.add_argument("--bodies", type=int, default=128, help="held-out bodies")
    parser.add_argument("--out", required=True, help="folder of certificate.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
