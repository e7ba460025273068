"""Speed of the flow solver: against cells, in batches, with gradients, against finite elements.

python scripts/measure_speed.py --out out/speed

The rival needs NGSolve: pip install -e '.[bench]'.
"""

import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from common import Parser, emit, markdown, progress_bar, run
from measure_flow import UNBOUNDED
from rival_flow import solve_by_finite_elements

from surrogate.body.family import ellipse, family_markers
from surrogate.errors import InvalidInput
from surrogate.files import whole_file
from surrogate.flow.grid.domain import make_domain
from surrogate.flow.flow import family_drag_and_gradient, family_drag_and_shape_gradient, solve
from surrogate.scene.scene import FIDELITIES, Fidelity, Scene, Unbounded
from surrogate.training.physics import draw_samples, scene_domain, solve_labels

CELLS = (8, 16, 32, 64, 118)
BATCHES = (1, 4, 16)
REYNOLDS = (1.0, 10.0, 40.0)


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Measure four tables, print them, keep them as JSON."""
    arguments = _parser().parse_args(argv)
    result: dict[str, Any] = {}
    with progress_bar("measuring speed") as progress:
        for k, table in enumerate((_against_cells, _gradients, _batches, _rival)):
            progress(k / 4, table.__name__.strip("_").replace("_", " "))
            result |= table()
        progress(1.0)
    with whole_file(Path(arguments.out) / "speed.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, _text(result))


def _against_cells() -> dict[str, Any]:
    """Cylinder at Re 10 on ever finer grids: seconds, memory and the exponent of time in cells."""
    rows = []
    for n in CELLS:
        domain = make_domain(Unbounded(), Fidelity("", n, 6, 12, 8), (1.25, 1.25), symmetric=True)
        markers = family_markers(jnp.asarray(ellipse(1.0)), domain.nodes)
        compiled = solve.lower(domain, markers, jnp.asarray(10.0)).compile()
        memory = compiled.memory_analysis()
        rows.append(
            {
                "n": n,
                "cells": int(np.prod(domain.lattice.shape)),
                "seconds": _median(lambda c=compiled, m=markers: c(m, jnp.asarray(10.0)), 3),
                "megabytes": (memory.temp_size_in_bytes + memory.output_size_in_bytes) / 1e6,
            }
        )
    logs = np.log([[row["cells"], row["seconds"]] for row in rows])
    return {"cells": rows, "exponent": float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])}


def _gradients() -> dict[str, Any]:
    """What a gradient adds to a drag, in drags; the ellipse of aspect 2 at standard."""
    domain, body = scene_domain(Scene()), jnp.asarray(ellipse(2.0))
    markers = family_markers(body, domain.nodes)
    rows = []
    for reynolds in REYNOLDS:
        re = jnp.asarray(reynolds)
        alone, shape, whole = _medians(
            [
                lambda re=re: solve(domain, markers, re),
                lambda re=re: family_drag_and_shape_gradient(domain, body, re),
                lambda re=re: family_drag_and_gradient(domain, body, re),
            ]
        )
        rows.append(
            {
                "reynolds": reynolds,
                "seconds": alone,
                "shape_gradient": shape / alone - 1,
                "gradient_with_reynolds": whole / alone - 1,
            }
        )
    return {"gradients": rows}


def _batches() -> dict[str, Any]:
    """Body flows per second of random bodies, each at its own Re: one program for a batch."""
    rows = [_batch(name, size) for name in ("draft", "standard") for size in BATCHES]
    return {"batches": rows}


def _batch(name: str, size: int) -> dict[str, Any]:
    scene = Scene(fidelity=FIDELITIES[name])
    domain, samples = scene_domain(scene), draw_samples(scene, jax.random.key(0), size)

    def drag(parameters, reynolds):
        return solve(domain, family_markers(parameters, domain.nodes), reynolds).coefficients.drag

    together = jax.jit(jax.vmap(drag))
    in_turn, vmapped = _medians([lambda: solve_labels(domain, samples), lambda: together(*samples)])
    return {
        "fidelity": name,
        "batch": size,
        "per_second_in_turn": size / in_turn,
        "per_second_vmapped": size / vmapped,
    }


def _rival() -> dict[str, Any]:
    """Cylinder at standard against finite elements of third order in a box of 60 D."""
    domain = make_domain(Unbounded(), FIDELITIES["standard"], (1.25, 1.25), symmetric=True)
    markers = family_markers(jnp.asarray(ellipse(1.0)), domain.nodes)
    rows = []
    for reynolds in REYNOLDS:
        re = jnp.asarray(reynolds)
        ours = float(solve(domain, markers, re).coefficients.drag)
        seconds, others = [], []
        for _ in range(3):
            seconds.append(_median(lambda re=re: solve(domain, markers, re), 15))
            try:
                others.append(solve_by_finite_elements(reynolds))
            except InvalidInput:
                return {"rival": None}
        rows.append(
            {
                "reynolds": reynolds,
                "error": ours / UNBOUNDED[reynolds] - 1,
                "seconds": float(np.median(seconds)),
                "rival_error": others[0].cd / UNBOUNDED[reynolds] - 1,
                "rival_seconds": float(np.median([other.seconds for other in others])),
                "rival_unknowns": others[0].unknowns,
            }
        )
    return {"rival": rows}


def _median(call: Callable[[], Any], repeats: int) -> float:
    return _medians([call], repeats)[0]


def _medians(calls: list[Callable[[], Any]], repeats: int = 7) -> list[float]:
    """Median seconds of every call, taken in turns so that a busy machine hurts all alike."""
    for call in calls:
        jax.block_until_ready(call())
    seconds = np.zeros((repeats, len(calls)))
    for k in range(repeats):
        for j, call in enumerate(calls):
            start = time.perf_counter()
            jax.block_until_ready(call())
            seconds[k, j] = time.perf_counter() - start
    return np.median(seconds, axis=0).tolist()


def _text(r: dict[str, Any]) -> str:
    """Markdown tables."""
    cells = [
        [str(row["n"]), str(row["cells"]), f"{row['seconds']:.3f} s", f"{row['megabytes']:.0f} MB"]
        for row in r["cells"]
    ]
    gradients = [
        [
            f"{row['reynolds']:g}",
            f"{1000 * row['seconds']:.0f} ms",
            f"+{row['shape_gradient']:.2f}",
            f"+{row['gradient_with_reynolds']:.2f}",
        ]
        for row in r["gradients"]
    ]
    batches = [
        [
            row["fidelity"],
            str(row["batch"]),
            f"{row['per_second_in_turn']:.1f}",
            f"{row['per_second_vmapped']:.1f}",
        ]
        for row in r["batches"]
    ]
    tables = [
        markdown(["cells per D", "cells", "time", "memory"], cells),
        f"time grows as cells to the power {r['exponent']:.2f}",
        markdown(["Re", "a drag", "shape gradient", "gradient with Re"], gradients),
        markdown(["fidelity", "batch", "flows per s in turn", "vmapped"], batches),
    ]
    if r["rival"]:
        heads = ["Re", "ours", "error", "finite elements", "error", "times faster"]
        tables.append(markdown(heads, [_rival_line(row) for row in r["rival"]]))
    else:
        tables.append("NGSolve is not installed, so the rival was left out")
    return "\n\n".join(tables)


def _rival_line(row: dict[str, Any]) -> list[str]:
    return [
        f"{row['reynolds']:g}",
        f"{1000 * row['seconds']:.0f} ms",
        f"{100 * row['error']:+.2f} %",
        f"{1000 * row['rival_seconds']:.0f} ms",
        f"{100 * row['rival_error']:+.2f} %",
        f"{row['rival_seconds'] / row['seconds']:.0f}",
    ]


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", required=True, help="folder of speed.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
