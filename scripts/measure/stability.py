"""Where each method trains, stalls or blows up: truncation, exponent, batch, steps, Re, precision.

python scripts/measure_stability.py --out out/stability
"""

import dataclasses
import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import matplotlib
from common import Parser, emit, finite, markdown, progress_bar, run

from surrogate.errors import NotConverged
from surrogate.files import whole_file
from surrogate.training.methods.dp import differentiable_physics
from surrogate.training.methods.hig import half_inverse_gradients
from surrogate.training.loop import Bench, drag_errors, make_bench, train
from surrogate.training.methods.method import Method
from surrogate.training.presets import Plan, preset
from surrogate.training.methods.sip import scale_invariant_physics
from surrogate.training.methods.supervised import supervised

matplotlib.use("Agg")
import matplotlib.pyplot as plt

MAKERS: dict[str, Callable[..., Method]] = {
    "dp": differentiable_physics,
    "sip": scale_invariant_physics,
    "hig": half_inverse_gradients,
    "supervised": supervised,
}
BUDGET = {"dp": 40, "sip": 16, "hig": 12, "supervised": 16}  # iterations
BATCH = {"dp": 4, "sip": 8, "hig": 16, "supervised": 8}
STEP = {
    "dp": ("learning_rate", 1e-2),
    "sip": ("learning_rate", 3e-3),
    "hig": ("eta", 1.0),
    "supervised": ("learning_rate", 3e-3),
}
HELD_OUT = 16
TRAINED, STALLED, WORSE = 0.1, 0.9, 1.1  # of the untrained network's error


class Variant(NamedTuple):
    """One cell of the map."""

    panel: str
    method: str
    value: str
    settings: dict[str, Any]
    reynolds: tuple[float, float] = (1.0, 40.0)
    single: bool = False
    samples: int = 64


def variants() -> Iterator[Variant]:
    """All cells, panel by panel."""
    for tau in (1e-12, 1e-8, 1e-5, 1e-3, 1e-2, 1e-1):
        yield Variant("truncation tau", "hig", f"{tau:g}", {"tau": tau})
    for kappa in (-1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 1.0):
        yield Variant("exponent kappa", "hig", f"{kappa:g}", {"kappa": kappa})
    for method, (name, value) in STEP.items():
        for factor in (0.01, 0.1, 1.0, 10.0, 100.0):
            yield Variant("step size, times", method, f"{factor:g}", {name: factor * value})
        for batch in (1, 4, 16, 64, 256):
            large = {"lanczos": 128} if method == "hig" and batch > 64 else {}
            settings = {"batch": batch} | large
            yield Variant("batch (of 256)", method, f"{batch}", settings, samples=256)
        for reynolds in ((10.0, 20.0), (1.0, 40.0), (0.1, 45.0)):
            label = f"{reynolds[0]:g} to {reynolds[1]:g}"
            yield Variant("Reynolds range", method, label, {}, reynolds)
        for single, label in ((False, "float64"), (True, "float32")):
            yield Variant("weights", method, label, {}, single=single)


def rounded(method: Method) -> Method:
    """The method with weights that are rounded to single precision after every update."""

    def update(network, state, physics, batch, done):
        network, state, spent = method.update(network, state, physics, batch, done)
        weights = network.weights.astype(jnp.float32).astype(float)
        return network.with_weights(weights), state, spent

    return method._replace(update=update)


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Train every variant from the same weights for a small budget; picture and table."""
    arguments = _parser().parse_args(argv)
    cells, benches = list(variants()), {}
    rows = []
    with progress_bar("stability") as progress:
        for k, cell in enumerate(cells):
            plan = _plan(cell, arguments.seed)
            ground = cell.reynolds, cell.samples
            if ground not in benches:
                benches[ground] = make_bench(plan)
            rows.append(_row(cell, plan, benches[ground]))
            name = f"{cell.method}, {cell.panel} {cell.value}"
            progress((k + 1) / len(cells), f"{name}: {rows[-1]['outcome']}")
    out = Path(arguments.out)
    _plot(rows, out / "stability.png")
    result = {"rows": rows, "plot": str(out / "stability.png")}
    with whole_file(out / "stability.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, _text(rows))


def _plan(cell: Variant, seed: int) -> Plan:
    plan = preset(cell.method, "quick", seed)
    return dataclasses.replace(
        plan,
        scene=dataclasses.replace(plan.scene, reynolds=cell.reynolds),
        samples=cell.samples,
        held_out=HELD_OUT,
        iterations=_iterations(cell),
        report_every=1,
    )


def _iterations(cell: Variant) -> int:
    """The method's budget; small batches get more steps, up to three times as many."""
    usual = BATCH[cell.method]
    batch = cell.settings.get("batch", usual)
    return round(BUDGET[cell.method] * min(max(usual / batch, 1.0), 3.0))


def _row(cell: Variant, plan: Plan, bench: Bench) -> dict[str, Any]:
    drags = -2 * bench.labels.amplitude[:, 0]
    before = float(drag_errors(bench.network, bench.held_out, drags).mean())
    method = MAKERS[cell.method](**{"batch": BATCH[cell.method]} | cell.settings)
    row: dict[str, Any] = {"panel": cell.panel, "method": cell.method, "value": cell.value}
    row |= {"before": before}
    try:
        trained = train(plan, bench, method=rounded(method) if cell.single else method)
    except NotConverged:
        return row | {"after": None, "outcome": "blew up", "left_out": 0}
    last = trained.history[-1]
    share = last.error_mean / before
    outcome = (
        "trained"
        if share < TRAINED
        else "slow"
        if share < STALLED
        else "stalled"
        if share < WORSE
        else "diverged"
    )
    return row | {
        "after": finite(last.error_mean),
        "outcome": "blew up" if trained.stopped else outcome,
        "left_out": last.failed,
    }


COLOURS = {
    "trained": "#4c9f70",
    "slow": "#b8d8a0",
    "stalled": "#e8c468",
    "diverged": "#e08e58",
    "blew up": "#c8553d",
}


def _plot(rows: list[dict[str, Any]], path: Path) -> None:
    panels = list(dict.fromkeys(row["panel"] for row in rows))
    figure, axes = plt.subplots(
        2, math.ceil(len(panels) / 2), figsize=(13, 6), layout="constrained"
    )
    for axis, panel in zip(axes.flat, panels, strict=True):
        mine = [row for row in rows if row["panel"] == panel]
        values = list(dict.fromkeys(row["value"] for row in mine))
        methods = list(dict.fromkeys(row["method"] for row in mine))
        for row in mine:
            x, y = values.index(row["value"]), methods.index(row["method"])
            axis.add_patch(plt.Rectangle((x - 0.5, y - 0.5), 1, 1, color=COLOURS[row["outcome"]]))
            error = "" if row["after"] is None else f"{100 * row['after']:.3g} %"
            axis.text(x, y, error, ha="center", va="center", fontsize=8)
        axis.set(xlim=(-0.5, len(values) - 0.5), ylim=(len(methods) - 0.5, -0.5), title=panel)
        axis.set_xticks(range(len(values)), values, fontsize=8)
        axis.set_yticks(range(len(methods)), methods)
    handles = [plt.Rectangle((0, 0), 1, 1, color=colour) for colour in COLOURS.values()]
    figure.legend(handles, list(COLOURS), loc="outside lower center", ncols=5, frameon=False)
    with whole_file(path) as part:
        figure.savefig(part, dpi=140)
    plt.close(figure)


def _text(rows: list[dict[str, Any]]) -> str:
    heads = ["what", "value", "method", "mean drag error", "left out", "outcome"]
    lines = [
        [
            row["panel"],
            row["value"],
            row["method"],
            "-" if row["after"] is None else f"{100 * row['after']:.2f} %",
            str(row["left_out"]),
            row["outcome"],
        ]
        for row in rows
    ]
    return markdown(heads, lines)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", required=True, help="folder of stability.json and stability.png")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
