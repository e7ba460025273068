"""What training costs and what it gives: every method and its rivals on the same bodies.

    python scripts/measure/training.py --seeds 3
    python scripts/measure/training.py --preset quick --surrogates out/quick

Kriging needs scikit-learn: pip install -e '.[bench]'.
"""

import dataclasses
import functools
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np
from gradients import adjoint_slopes, distance
from rivals import Fit, rivals
from study import TINY, Result, Study, run_study, table

from shapeopt.render.figures import STYLE, plt, save_figure
from surrogate import NotConverged
from surrogate.checks import whole_number
from surrogate.flow.steps import Labels
from surrogate.model.network import DragNetwork
from surrogate.training.loop import Bench, run_training
from surrogate.training.methods.method import Method
from surrogate.training.methods.sip import scale_invariant_physics
from surrogate.training.methods.supervised import supervised
from surrogate.training.plan import PRESETS, Plan, make_plan
from surrogate.training.samples import Samples
from surrogate.training.train import train_all, train_with_bar

MARKS = (0.03, 0.01, 0.003)  # drag errors whose price is told
SHARES = (0.125, 0.25, 0.5, 1.0)  # of the samples that rivals are given
GRADIENTS = 64  # held-out bodies whose shape gradients are compared
VARIANTS = {  # the method as published, and regressions that a user might try
    "sip, as published": functools.partial(scale_invariant_physics, slopes=0.0),
    "supervised, traction only": functools.partial(supervised, goal=0.0),
    "supervised, drag only": functools.partial(supervised, modes=0.0, goal=1.0),
    "supervised, with slopes": functools.partial(supervised, slopes=1.0),
}
Row = dict[str, Any]


def measure(tiny: bool, progress: Callable, seeds: int, preset: str, surrogates: Path) -> Result:
    """Train what is not trained yet, fit the rivals."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as scratch:
        first = Path(scratch) if tiny else surrogates
        for seed in range(whole_number("--seeds", seeds, 1, 20)):
            folder = first if seed == 0 else first / f"seed{seed}"
            rows += _rows(functools.partial(_plan, preset, seed, tiny), folder, tiny)
    return {"preset": preset, "seeds": seeds, "rivals": list(rivals()), "rows": rows}


def shrunk(plan: Plan) -> Plan:
    """As small as a training can be."""
    scene = dataclasses.replace(plan.scene, fidelity=TINY)
    small = {"samples": 8, "held_out": 4, "iterations": 2, "report_every": 1}
    return dataclasses.replace(plan, scene=scene, **small)


def attempt(plan: Plan, bench: Bench, method: Method) -> Row:
    """What comes of a training; its ``outcome`` is "trained" where nothing went wrong."""
    try:
        trained = run_training(plan, bench, method=method)
    except NotConverged as problem:
        return dict.fromkeys(("mean", "max", "work", "failed")) | {"outcome": str(problem)}
    last, outcome = trained.history[-1], trained.stopped or "trained"
    errors = {"mean": last.error_mean, "max": last.error_max, "outcome": outcome}
    return errors | {"work": last.green_applications, "failed": last.failed}


def _plan(preset: str, seed: int, tiny: bool, method: str) -> Plan:
    plan = make_plan(None, method, preset, None, seed)
    return shrunk(plan) if tiny else plan


def _rows(make: Callable[[str], Plan], folder: Path, tiny: bool) -> Iterator[Row]:
    """One seed: the four methods, their variants, and the rivals."""
    surrogates, bench = train_all(make, folder)
    seed, slopes = (
        make("dp").seed,
        adjoint_slopes(bench.physics.flow, bench.held_out.head(GRADIENTS)),
    )
    networks = {
        method: (s.network, s.record["history"], s.record["setup_s"])
        for method, s in surrogates.items()
    }
    for method, maker in () if tiny else VARIANTS.items():
        plan = make(method.split(",")[0])
        trained = train_with_bar(plan, bench, method=maker(), title=method)
        history = [list(point[:5]) for point in trained.history]
        networks[method] = trained.network, history, bench.setup_s
    for method, parts in networks.items():
        yield {"method": method, "seed": seed} | _learned(bench, slopes, *parts)
    labels = bench.physics.flow.labels(*bench.physics.samples) if rivals() else None
    for method, fit in rivals().items():
        yield {"method": method, "seed": seed} | _fitted(bench, labels, slopes, fit)


def _learned(bench: Bench, slopes, network: DragNetwork, history, setup_s: float) -> Row:
    """A network's row; the error of the traction is in units of its spread."""
    predicted = np.asarray(jax.vmap(network)(*bench.held_out))
    scale = np.asarray(jax.vmap(network.scale)(bench.held_out.reynolds))
    miss = (predicted - np.asarray(bench.labels.amplitude)) / scale
    drags = np.asarray(jax.vmap(network.drag)(*bench.held_out))
    gradients = np.asarray(jax.vmap(jax.grad(network.drag))(*bench.held_out.head(len(slopes))))
    work, seconds = history[-1][2], history[-1][1] + setup_s
    costs = {"green_applications": work, "seconds": seconds, "setup_s": setup_s}
    traction = {"traction": float(np.sqrt(np.mean(miss**2)))}
    return _errors(bench, slopes, drags, gradients, history) | traction | costs


def _fitted(bench: Bench, labels: Labels, slopes, fit: Fit) -> Row:
    """A rival's row: log Cd fitted on shares of the solved samples, at shares of their work."""
    inputs, unseen = _inputs(bench, bench.physics.samples), _inputs(bench, bench.held_out)
    work, history = int(np.sum(labels.green_applications)), []
    for share in SHARES:
        count = round(share * len(inputs))
        predict = fit(inputs[:count], np.log(labels.drag[:count]))
        drags = np.exp(predict(unseen))
        errors = np.abs(drags / np.asarray(bench.labels.drag) - 1)
        history.append([count, 0.0, round(share * work), errors.mean(), errors.max()])
    widths, few = _widths(bench), unseen[: len(slopes)]
    step = 2e-3 * np.eye(unseen.shape[1])[: len(widths)]  # a thousandth of a range, both ways
    logs = [np.stack([predict(few + way * side) for side in step], axis=1) for way in (1, -1)]
    gradients = drags[: len(few), None] * (logs[0] - logs[1]) / (2e-3 * widths)
    costs = {"green_applications": work, "seconds": None, "setup_s": None, "traction": None}
    return _errors(bench, slopes, drags, gradients, history) | costs


def _errors(bench: Bench, slopes, drags, gradients, history) -> Row:
    errors = np.abs(drags / np.asarray(bench.labels.drag) - 1)
    return {
        "error_mean": errors.mean(),
        "error_p95": np.percentile(errors, 95),
        "error_max": errors.max(),
        "gradient": distance(gradients, slopes, _widths(bench)),
        "history": history,
    }


def _inputs(bench: Bench, samples: Samples) -> np.ndarray:
    """Shape parameters and log Re, scaled to [-1, 1] as the network's are."""
    raw = np.column_stack([samples.parameters, np.log(samples.reynolds)])
    low, high = np.asarray(bench.network.low), np.asarray(bench.network.high)
    return 2 * (raw - low) / (high - low) - 1


def _widths(bench: Bench) -> np.ndarray:
    return np.ptp(bench.physics.flow.scene.family.bounds, axis=1)


def draw(result: Result, path: Path) -> None:
    """Mean drag error of every history: work of all seeds, time of the first alone."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained", sharey=True)
    methods = list(by_method(result))
    for row in result["rows"]:
        first = row["seed"] == result["rows"][0]["seed"]
        look = {"color": f"C{methods.index(row['method'])}", "ms": 3}
        look["label"] = row["method"] if first else None
        for axis, column in zip(axes, (2, 1), strict=True) if first else [(axes[0], 2)]:
            points = [(p[column], 100 * p[3]) for p in row["history"] if p[column] > 0]
            if points:
                style = "o--" if row["seconds"] is None else "-"
                axis.loglog(*zip(*points, strict=True), style, **look)
    axes[0].set(xlabel="applications of G", ylabel="mean drag error, %")
    axes[1].set(xlabel="seconds of training (first seed)")
    for axis in (axes[0].xaxis, axes[1].xaxis, axes[0].yaxis):
        axis.set_minor_formatter("")
    axes[0].yaxis.set_major_formatter("{x:g}")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right center", frameon=False)
    save_figure(figure, path)


def by_method(result: Result) -> dict[str, list[Row]]:
    """The rows of every method, one a seed."""
    methods = dict.fromkeys(row["method"] for row in result["rows"])
    return {name: [row for row in result["rows"] if row["method"] == name] for name in methods}


def summary(result: Result) -> list[Row]:
    """A row of words a method: means over the seeds with half the spread; times of the first."""
    rows = []
    for method, mine in by_method(result).items():
        row = {"method": method, "seconds": mine[0]["seconds"]}
        row["work"] = np.mean([one["green_applications"] for one in mine])
        for key in ("error_mean", "error_p95", "error_max", "traction", "gradient"):
            row[key] = _spread([one[key] for one in mine])
        rows.append(row | {f"price{k}": _price(mine, mark) for k, mark in enumerate(MARKS)})
    return rows


def _spread(values: list[float | None]) -> str:
    if None in values:
        return "-"
    around = f" ± {50 * np.ptp(values):.2f}" if len(values) > 1 else ""
    return f"{100 * np.mean(values):.2f}{around} %"


def _price(mine: list[Row], mark: float) -> str:
    """Applications of G (and seconds) until the mean error was first below the mark."""
    reached = [next((p for p in row["history"] if p[3] <= mark), None) for row in mine]
    if None in reached:
        return "-"
    time = "" if mine[0]["setup_s"] is None else f" ({reached[0][1] + mine[0]['setup_s']:.0f} s)"
    return f"{np.mean([point[2] for point in reached]):.0f}{time}"


def tables(result: Result) -> str:
    heads = "method | drag: mean | 95 % | max | traction | gradient | G | time"
    forms = "{method} | {error_mean} | {error_p95} | {error_max} | {traction} | {gradient}"
    forms += " | {work:.0f} | {seconds:.0f} s"
    for k, mark in enumerate(MARKS):
        heads, forms = f"{heads} | G (time) to {100 * mark:g} %", f"{forms} | {{price{k}}}"
    missing = "" if result["rivals"] else "\n\nscikit-learn is not installed: no rivals."
    return table(summary(result), heads, forms) + missing


OPTIONS = {
    "--seeds": {"type": int, "default": 1, "help": "how many, from 0"},
    "--preset": {"default": "full", "choices": list(PRESETS)},
    "--surrogates": {"type": Path, "default": Path("out/full"), "help": "folder of the trainings"},
}
STUDY = Study("training", measure, tables, draw, OPTIONS)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
