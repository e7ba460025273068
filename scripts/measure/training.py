"""What training costs and what it gives: every method and its rivals on the same bodies.

    python scripts/measure/training.py --seeds 3
    python scripts/measure/training.py --preset quick --surrogates out/quick

Kriging needs scikit-learn: pip install -e '.[bench]'.
"""

import dataclasses
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
from gradients import adjoint_slopes, distance
from rivals import Fit, Solved, rivals
from study import TINY, Result, Study, cold_cache, run_study, table

from shapeopt.render.figures import STYLE, plt, save_figure
from shapeopt.search.memory import Memory
from surrogate import Flow, NotConverged, Surrogate
from surrogate.checks import whole_number
from surrogate.flow.batch import FlowBatch
from surrogate.model.inputs import scene_inputs
from surrogate.training.loop import TrainingResult, TrainingSetup, make_setup, run_training
from surrogate.training.methods.method import Method
from surrogate.training.plan import PRESETS, Plan, compared_plans
from surrogate.training.samples import Samples, held_out_samples, training_samples
from surrogate.training.train import train_all

MARKS = (0.01, 0.003, 0.001)  # drag errors whose price is told
SHARES = (0.0625, 0.125, 0.25, 0.5, 1.0)  # of the samples that rivals are given
GRADIENTS = 64  # held-out bodies whose shape gradients are compared
Row = dict[str, Any]


def measure(tiny: bool, progress: Callable, seeds: int, preset: str, surrogates: Path) -> Result:
    """Train what is not trained yet, fit the rivals."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as scratch:
        first = Path(scratch) if tiny else surrogates
        for seed in range(whole_number("--seeds", seeds, 1, 20)):
            plans = compared_plans(None, "quick" if tiny else preset, seed=seed)
            plans = {name: shrunk(plan) for name, plan in plans.items()} if tiny else plans
            rows += compared(plans, first if seed == 0 else first / f"seed{seed}")
    return {"preset": preset, "seeds": seeds, "rivals": list(rivals()), "rows": rows}


def shrunk(plan: Plan) -> Plan:
    """As small as a training can be."""
    scene = dataclasses.replace(plan.scene, fidelity=TINY)
    small = {"samples": 8, "held_out": 4, "iterations": 2, "report_every": 1}
    return dataclasses.replace(plan, scene=scene, **small)


def attempt(plan: Plan, bench: TrainingSetup, method: Method) -> Row:
    """What comes of a training; its ``outcome`` is "trained" where nothing went wrong."""
    try:
        trained = run_training(plan, bench, method=method)
    except NotConverged as problem:
        return dict.fromkeys(("mean", "max", "work", "failed")) | {"outcome": str(problem)}
    last, outcome = trained.history[-1], trained.stopped or "trained"
    errors = {"mean": last.error_mean, "max": last.error_max, "outcome": outcome}
    return errors | {"work": last.green_applications, "failed": last.failed}


def compared(plans: Mapping[str, Plan], folder: Path) -> Iterator[Row]:
    """One seed: the methods at their best, as published, of few bodies, and the rivals."""
    surrogates, most = train_all(plans, folder), next(iter(plans.values()))
    flow, unseen = Flow(most.scene), held_out_samples(most.scene, most.seed, most.held_out)
    truth = Truth(unseen, flow.labels(*unseen), adjoint_slopes(flow, unseen.head(GRADIENTS)))
    for name, surrogate in surrogates.items():
        compile_s = compile_seconds(plans[name]) if most.seed == 0 else None
        row = {"method": name, "seed": most.seed, "compile_s": compile_s}
        yield row | learned(truth, surrogate)
    solved, work = solved_samples(flow, training_samples(most.scene, most.seed, most.samples))
    for name, fit in rivals().items():
        yield {"method": name, "seed": most.seed} | _fitted(truth, solved, work, fit)


def compile_seconds(plan: Plan) -> float:
    """What compiling a training takes where nothing is kept of an earlier one."""
    short = dataclasses.replace(plan, held_out=4, iterations=1, report_every=1, budget_s=None)
    with cold_cache():
        bench = make_setup(short)
        return bench.compile_s + run_training(short, bench).compile_s


class Truth(NamedTuple):
    """Held-out bodies, their flows, and the shape gradients of the first of them."""

    bodies: Samples
    labels: FlowBatch
    slopes: np.ndarray


def learned(truth: Truth, surrogate: Surrogate) -> Row:
    """A network's row."""
    record, drag = surrogate.record, surrogate.network.drag
    history = record["history"]
    costs = {"green_applications": history[-1][2], "setup_s": record["setup_s"]}
    costs["seconds"] = history[-1][1] + record["setup_s"]
    drags = np.asarray(jax.vmap(drag)(*truth.bodies))
    gradients = np.asarray(jax.vmap(jax.grad(drag))(*truth.bodies.head(len(truth.slopes))))
    return _errors(truth, drags, gradients, history) | costs


def solved_samples(flow: Flow, samples: Samples) -> tuple[Solved, int]:
    """What rivals learn from, and the work of flows and adjoints."""
    inputs, memory = scene_inputs(flow.scene), Memory(flow, None)
    told = [memory.ask(p, float(re)) for p, re in zip(*samples, strict=True)]
    return Solved(inputs, np.asarray(jax.vmap(inputs)(*samples)), told), memory.green_applications


def timed_fit(plan: Plan, bench: TrainingSetup) -> tuple[TrainingResult, float]:
    """A training, and the CPU seconds of its steps at the pace they have once flows are known."""
    seconds: list[tuple[int, float]] = []
    trained = run_training(
        plan, bench, report=lambda point, _: seconds.append((point.iteration, time.process_time()))
    )
    (first, begin), (last, end) = seconds[len(seconds) // 2], seconds[-1]
    return trained, (end - begin) / max(last - first, 1) * plan.iterations


def _fitted(truth: Truth, solved: Solved, work: int, fit: Fit) -> Row:
    """A rival's row: log Cd fitted on shares of the solved samples, at shares of their work."""
    unseen, history = np.asarray(jax.vmap(solved.inputs)(*truth.bodies)), []
    for share in SHARES:
        count = max(4, round(share * len(solved.told)))
        predict = fit(solved.head(count))
        drags = np.exp(predict(unseen))
        errors = np.abs(drags / np.asarray(truth.labels.drag) - 1)
        history.append([count, 0.0, round(share * work), errors.mean(), errors.max()])
    few = truth.bodies.head(len(truth.slopes))
    scene_slopes = np.asarray(jax.vmap(solved.inputs.steepness)(few.parameters))[:, :-1]
    step = 1e-3 * np.eye(unseen.shape[1])[: scene_slopes.shape[1]]
    logs = [
        np.stack([predict(unseen[: few.count] + way * side) for side in step], axis=1)
        for way in (1, -1)
    ]
    gradients = drags[: few.count, None] * (logs[0] - logs[1]) / (2e-3 * scene_slopes)
    costs = {"green_applications": work, "seconds": None, "setup_s": None, "compile_s": None}
    return _errors(truth, drags, gradients, history) | costs


def _errors(truth: Truth, drags, gradients, history) -> Row:
    errors = np.abs(drags / np.asarray(truth.labels.drag) - 1)
    widths = np.ptp(np.asarray(truth.bodies.parameters), axis=0)  # nearly the family's
    return {
        "error_mean": errors.mean(),
        "error_p95": np.percentile(errors, 95),
        "error_max": errors.max(),
        "gradient": distance(gradients, truth.slopes, widths),
        "history": history,
    }


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
        row = {"method": method} | _times(mine[0]["seconds"], mine[0]["compile_s"])
        row["work"] = np.mean([one["green_applications"] for one in mine])
        for key in ("error_mean", "error_p95", "error_max", "gradient"):
            row[key] = _spread([one[key] for one in mine])
        rows.append(row | {f"price{k}": _price(mine, mark) for k, mark in enumerate(MARKS)})
    return rows


def _times(seconds: float | None, compile_s: float | None) -> dict[str, str]:
    """Of a training, without and with what is compiled first; rivals compile nothing."""
    if seconds is None:
        return {"time": "-", "first": "-"}
    return {"time": f"{seconds:.0f} s", "first": f"{seconds + compile_s:.0f} s"}


def _spread(values: list[float | None]) -> str:
    if None in values:
        return "-"
    around = f" ± {50 * np.ptp(values):.3f}" if len(values) > 1 else ""
    return f"{100 * np.mean(values):.3f}{around} %"


def _price(mine: list[Row], mark: float) -> str:
    """Applications of G (and seconds) until the mean error was first below the mark."""
    reached = [next((p for p in row["history"] if p[3] <= mark), None) for row in mine]
    if None in reached:
        return "-"
    time = "" if mine[0]["setup_s"] is None else f" ({reached[0][1] + mine[0]['setup_s']:.0f} s)"
    return f"{np.mean([point[2] for point in reached]):.0f}{time}"


def tables(result: Result) -> str:
    heads = "method | drag: mean | 95 % | max | gradient | G | time | with compilation"
    forms = "{method} | {error_mean} | {error_p95} | {error_max} | {gradient}"
    forms += " | {work:.0f} | {time} | {first}"
    for k, mark in enumerate(MARKS):
        heads, forms = f"{heads} | G (time) to {100 * mark:g} %", f"{forms} | {{price{k}}}"
    return table(summary(result), heads, forms)


OPTIONS = {
    "--seeds": {"type": int, "default": 1, "help": "how many, from 0"},
    "--preset": {"default": "full", "choices": list(PRESETS)},
    "--surrogates": {"type": Path, "default": Path("out/full"), "help": "folder of the trainings"},
}
STUDY = Study("training", measure, tables, draw, OPTIONS)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
