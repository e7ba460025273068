"""What single precision throughout costs and loses in the flow, against the solver's double.

python scripts/measure_precision.py --out out/precision
"""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from common import Parser, emit, finite, markdown, progress_bar, run

from surrogate.body.family import ellipse, family_markers
from surrogate.files import check_folder, whole_file
from surrogate.flow.solver import steady
from surrogate.flow.flow import body_domain
from surrogate.flow.loads.forces import drag_coefficient
from surrogate.flow.solver.newton import single
from surrogate.scene.scene import FIDELITIES, Unbounded

CASES = [(1.0, re) for re in (1e-3, 0.1, 1.0, 10.0, 40.0, 100.0, 300.0)]
CASES += [(0.5, 40.0), (5.0, 40.0), (10.0, 300.0)]  # aspect, Re
REPEATS = 5


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Every case in both precisions on the standard grid, after a common preparation."""
    arguments = _parser().parse_args(argv)
    check_folder(arguments.out)
    rows = []
    with progress_bar("precision") as progress:
        for k, (aspect, reynolds) in enumerate(CASES):
            progress(k / len(CASES), f"aspect {aspect:g}, Re {reynolds:g}")
            rows.append(_row(aspect, reynolds))
        progress(1.0)
    with whole_file(Path(arguments.out) / "precision.json") as part:
        part.write_text(json.dumps(rows, indent=1) + "\n")
    heads = ["aspect", "Re", "float64", "float32", "Cd differs by", "time"]
    lines = [
        [
            f"{r['aspect']:g}",
            f"{r['reynolds']:g}",
            _how(r["double"]),
            _how(r["single"]),
            "" if r["difference"] is None else f"{r['difference']:.0e}",
            f"{r['time_ratio']:.2f}",
        ]
        for r in rows
    ]
    return emit({"rows": rows}, arguments.json, markdown(heads, lines))


def _row(aspect: float, reynolds: float) -> dict[str, Any]:
    body = jnp.asarray(ellipse(aspect))
    outline = np.asarray(family_markers(body, 400))
    domain = body_domain(Unbounded(), FIDELITIES["standard"], outline, True, reynolds)
    markers = family_markers(body, domain.nodes)
    case = jax.jit(lambda m, re: steady.prepare(domain, m, re))(markers, jnp.asarray(reynolds))
    solve = jax.jit(lambda case: steady.body_flow(domain, case))
    cases = {"double": case, "single": single(case)}
    answers = {name: solve(case) for name, case in cases.items()}
    seconds: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(REPEATS):
        for name, case in cases.items():
            start = time.perf_counter()
            jax.block_until_ready(solve(case))
            seconds[name].append(time.perf_counter() - start)
    found = {
        name: {"converged": bool(info.converged), "products": int(info.products)}
        | {"residual": finite(float(info.residual))}
        for name, (_, info) in answers.items()
    }
    drags = {name: float(drag_coefficient(s.amplitude)) for name, (s, _) in answers.items()}
    both = all(one["converged"] for one in found.values())
    return {"aspect": aspect, "reynolds": reynolds, **found} | {
        "difference": abs(drags["single"] / drags["double"] - 1) if both else None,
        "time_ratio": float(np.median(seconds["single"]) / np.median(seconds["double"])),
    }


def _how(one: dict[str, Any]) -> str:
    return f"{one['products']} G" if one["converged"] else "not converged"


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", required=True, help="folder of precision.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
