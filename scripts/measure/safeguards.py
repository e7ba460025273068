"""Safeguards and fidelities of the physics: the quick training, one thing changed at a time.

python scripts/measure_safeguards.py --out out/safeguards
"""

import dataclasses
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from common import Parser, emit, finite, markdown, progress_bar, run

from surrogate.errors import NotConverged
from surrogate.files import whole_file
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.tangent import Effort
from surrogate.training.methods.dp import differentiable_physics
from surrogate.training.methods.hig import half_inverse_gradients
from surrogate.training.loop import Bench, make_bench, train
from surrogate.training.methods.method import Method
from surrogate.training.presets import Plan, preset
from surrogate.training.methods.sip import scale_invariant_physics

LOOSE_FLOW = NewtonSettings(tolerance=1e-2, max_steps=2, max_vectors=14)
EXACT = {"fidelity": "exact", "lag": 0.0, "batch": 24}
HIG = {
    "as shipped": {},
    "no truncation (tau 0)": {"tau": 0.0},
    "tau 1e-5": {"tau": 1e-5},
    "tau 1e-2": {"tau": 1e-2},
    "half steps (eta 0.5)": {"eta": 0.5},
    "fast decay (8)": {"decay": 8.0},
    "no goal row (goal 0)": {"goal": 0.0},
    "small batches (24)": {"batch": 24},
    "compliance followed (lag 0.1)": {"lag": 0.1},
    "compliance solved at every visit (lag 0)": {"lag": 0.0},
    "frozen: linearised at the solved flows": {"fidelity": "frozen"},
    "frozen, compliance of the solved flows": {"fidelity": "frozen", "lag": 0.1},
}
HIG_EXACT = {
    "exact: non-linear flow, compliance at every visit": {},
    "exact, compliance kept within 0.1": {"lag": 0.1},
    "exact, compliance kept within 0.3": {"lag": 0.3},
    "exact, Oseen compliance": {"lag": math.inf},
    "exact, loose flows, failures left out": {"settings": LOOSE_FLOW},
    "exact, loose flows, failures kept": {"settings": LOOSE_FLOW, "leave_out": False},
}
DP = {
    "exact: non-linear flow at every visit": {},
    "lagged": {"fidelity": "lagged"},
    "frozen": {"fidelity": "frozen"},
}
SIP = {
    "as shipped": {},
    "as published (no shape gradients)": {"slopes": 0.0},
    "every sample inverted each visit, none settled for its slope": {"settle": -1.0},
    "loose inversion (Krylov 0.3)": {"effort": Effort(0.3, 30)},
    "no goal (goal 0)": {"goal": 0.0},
    "one network step per inversion": {"network_steps": 1},
}


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Train every variant from the same weights on the same bodies; tabulate."""
    arguments = _parser().parse_args(argv)
    plans = {name: preset(name, "quick", arguments.seed) for name in ("dp", "hig", "sip")}
    short = dataclasses.replace(plans["hig"], iterations=30)
    bench = make_bench(short)
    variants = [(plans["hig"], name, half_inverse_gradients(**kw)) for name, kw in HIG.items()]
    variants += [
        (short, name, half_inverse_gradients(**EXACT | kw)) for name, kw in HIG_EXACT.items()
    ]
    variants += [(plans["dp"], name, differentiable_physics(**kw)) for name, kw in DP.items()]
    variants += [(plans["sip"], name, scale_invariant_physics(**kw)) for name, kw in SIP.items()]
    rows = []
    with progress_bar("safeguards") as progress:
        for k, (plan, name, update) in enumerate(variants):
            rows.append(_row(plan, name, bench, update))
            progress((k + 1) / len(variants), f"{plan.method}, {name}: {rows[-1]['outcome']}")
    with whole_file(Path(arguments.out) / "safeguards.json") as part:
        part.write_text(json.dumps(rows, indent=1) + "\n")
    return emit({"rows": rows}, arguments.json, _text(rows))


def _row(plan: Plan, variant: str, bench: Bench, method: Method) -> dict[str, Any]:
    row: dict[str, Any] = {"method": plan.method, "variant": variant}
    try:
        trained = train(dataclasses.replace(plan, report_every=1), bench, method=method)
    except NotConverged as problem:
        return row | {"outcome": str(problem), "mean": None, "max": None, "work": None, "failed": 0}
    last = trained.history[-1]
    return row | {
        "outcome": trained.stopped or "trained",
        "mean": finite(last.error_mean),
        "max": finite(last.error_max),
        "work": last.green_applications,
        "failed": last.failed,
    }


def _text(rows: list[dict[str, Any]]) -> str:
    heads = ["method", "variant", "mean", "max", "applications of G", "left out", "outcome"]
    lines = []
    for r in rows:
        errors = ["-" if r[k] is None else f"{100 * r[k]:.2f} %" for k in ("mean", "max")]
        counts = str(r["work"]), str(r["failed"])
        lines.append([r["method"], r["variant"], *errors, *counts, r["outcome"]])
    return markdown(heads, lines)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", required=True, help="folder of safeguards.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
