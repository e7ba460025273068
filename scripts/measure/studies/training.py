"""What training costs and what it gives, in 2-D and 3-D: all methods and rivals on the same bodies.

Kriging needs scikit-learn: pip install -e '.[bench]'.
"""

import dataclasses
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from figures import draw_lines
from rivals import Fit, Solved, rivals
from studies.accuracy import adjoint_slopes, distance
from study import TINY, Result, Row, Run, Study, Table, cases, columns, values
from tools import cold_cache

from shapeopt.search.memory import Memory
from surrogate import Flow, Scene, Surrogate
from surrogate.checks import whole_number
from surrogate.flow.batch import FlowBatch
from surrogate.model.inputs import scene_inputs
from surrogate.scene.samples import Samples, held_out_samples, training_samples
from surrogate.training.loop import TrainingResult, run_training
from surrogate.training.plan import METHODS, PRESETS, Plan, compared_plans, make_plan
from surrogate.training.setup import TrainingSetup, make_setup
from surrogate.training.train import train_all

SCENE = Path(__file__).parents[2] / "space.toml"
MARKS = (0.01, 0.003, 0.001)  # mean errors whose cost is shown
SHARES = (0.0625, 0.125, 0.25, 0.5, 1.0)  # of the samples, on which rivals are fitted
GRADIENTS = 64  # held-out bodies whose shape gradients are compared


def seeds(run: Run) -> list[Row]:
    """Return the cases, one for each seed."""
    return cases(seed=range(whole_number("--seeds", run.options["seeds"], 1, 20)))


def measure(run: Run, seed: int = 0, bodies: int | None = None) -> list[Row]:
    """Train what is not trained yet and fit the rivals; return a row of each.

    With ``bodies``, in 3-D, the methods are at their best.
    """
    if bodies:
        plans = {name: make_plan(Scene.read(SCENE), name, "full", bodies) for name in METHODS}
    else:
        plans = compared_plans(None, run.pick("quick", run.options["preset"]), seed)
    with tempfile.TemporaryDirectory() as scratch:
        if run.tiny:
            return compared({name: shrunk(plan) for name, plan in plans.items()}, Path(scratch))
        folder = run.options["surrogates"]
        return compared(plans, folder / f"seed{seed}" if seed else folder)


def shrunk(plan: Plan) -> Plan:
    """Return the plan of a tiny training."""
    scene = dataclasses.replace(plan.scene, fidelity=TINY)
    small = {"samples": 8, "held_out": 4, "iterations": 2, "report_every": 1}
    return dataclasses.replace(plan, scene=scene, **small)


def compared(plans: Mapping[str, Plan], folder: Path) -> list[Row]:
    """Return the rows of one seed, of networks and of rivals.

    Networks are by the methods at their best, as published, and on few bodies.
    """
    surrogates, most = train_all(plans, folder), next(iter(plans.values()))
    flow, unseen = Flow(most.scene), held_out_samples(most.scene, most.seed, most.held_out)
    slopes = adjoint_slopes(flow, unseen.head(GRADIENTS))
    truth, rows = Truth(unseen, flow.solve_all(*unseen, allow_unsteady=True), slopes), []
    for name, surrogate in surrogates.items():
        compile_s = compile_seconds(plans[name]) if most.seed == 0 else None
        row = {"method": name, "seed": most.seed, "compile_s": compile_s}
        rows.append(row | learned(truth, surrogate))
    solved, work = solved_samples(flow, training_samples(most.scene, most.seed, most.samples))
    for name, fit in rivals().items():
        rows.append({"method": name, "seed": most.seed} | _fitted(truth, solved, work, fit))
    return rows


def compile_seconds(plan: Plan) -> float:
    """Return the seconds of compilation of a training, nothing being compiled before."""
    short = dataclasses.replace(plan, held_out=4, iterations=1, report_every=1, budget_s=None)
    with cold_cache():
        setup = make_setup(short)
        return setup.compile_s + run_training(short, setup, method=plan.make_method()).compile_s


class Truth(NamedTuple):
    """Held-out bodies, their flows, and the shape gradients of the first of them."""

    bodies: Samples
    labels: FlowBatch
    slopes: np.ndarray


def learned(truth: Truth, surrogate: Surrogate) -> Row:
    """Return the row of a network: its errors and what its training cost."""
    record, drag = surrogate.record, surrogate.network.drag
    history = record["history"]
    costs = {"green_applications": history[-1][2], "setup_s": record["setup_s"]}
    costs["seconds"] = history[-1][1] + record["setup_s"]
    drags = np.asarray(jax.vmap(drag)(*truth.bodies))
    gradients = np.asarray(jax.vmap(jax.grad(drag))(*truth.bodies.head(len(truth.slopes))))
    return _errors(truth, drags, gradients, history) | costs


def solved_samples(flow: Flow, samples: Samples) -> tuple[Solved, int]:
    """Return drags and slopes that rivals are fitted to, and the work of flows and adjoints."""
    inputs, memory = scene_inputs(flow.scene), Memory(flow, None)
    observations = [memory.evaluate(p, float(re)) for p, re in zip(*samples, strict=True)]
    return Solved(
        inputs, np.asarray(jax.vmap(inputs)(*samples)), observations
    ), memory.green_applications


def timed_fit(plan: Plan, setup: TrainingSetup) -> tuple[TrainingResult, float]:
    """Run a training; return it, and the CPU seconds of all steps at the pace of the second half.

    By then all flows are known.
    """
    seconds: list[tuple[int, float]] = []
    trained = run_training(
        plan, setup, report=lambda point, _: seconds.append((point.iteration, time.process_time()))
    )
    (first, begin), (last, end) = seconds[len(seconds) // 2], seconds[-1]
    return trained, (end - begin) / max(last - first, 1) * plan.iterations


def _fitted(truth: Truth, solved: Solved, work: int, fit: Fit) -> Row:
    """The row of a rival: log Cd fitted on shares of the solved samples."""
    unseen, history = np.asarray(jax.vmap(solved.inputs)(*truth.bodies)), []
    for share in SHARES:
        count = max(4, round(share * len(solved.observations)))
        predict = fit(solved.head(count))
        drags = np.exp(predict(unseen))
        errors = np.abs(drags / np.asarray(truth.labels.drag) - 1)
        history.append([count, 0.0, round(share * work), errors.mean(), errors.max()])
    few = truth.bodies.head(len(truth.slopes))
    steepness = np.asarray(jax.vmap(solved.inputs.steepness)(few.parameters))[:, :-1]
    step = 1e-3 * np.eye(unseen.shape[1])[: steepness.shape[1]]
    ahead, behind = (
        np.stack([predict(unseen[: few.count] + sign * side) for side in step], axis=1)
        for sign in (1, -1)
    )
    gradients = drags[: few.count, None] * (ahead - behind) / (2e-3 * steepness)
    return _errors(truth, drags, gradients, history) | {"green_applications": work}


def _errors(truth: Truth, drags: np.ndarray, gradients: np.ndarray, history: list) -> Row:
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
    """Draw the mean drag error of every history, over the work and over the time.

    The work is of all seeds, the time of the first.
    """
    rows, work, time = result["rows"], [], []
    for row in rows:
        first = row["seed"] == rows[0]["seed"]
        look = {"color": f"C{values(rows, 'method').index(row['method'])}", "marker": None}
        look |= {"ls": "--", "marker": "o"} if row.get("seconds") is None else {}
        for drawn, column in ((work, 2), (time, 1)) if first else ((work, 2),):
            points = [(p[column], p[3]) for p in row["history"] if p[column] > 0]
            if points:
                drawn.append((row["method"] if first else None, points, look))
    panels = [("convolutions with G", work), ("seconds of training (first seed)", time)]
    draw_lines(panels, "mean drag error", path)


def summary(result: Result) -> list[Row]:
    """Return one row per method: means over the seeds, with half their spread.

    Times are of the first seed.
    """
    rows = []
    for method in values(result["rows"], "method"):
        mine = [row for row in result["rows"] if row["method"] == method]
        row = {"method": method, "work": np.mean([one["green_applications"] for one in mine])}
        if (seconds := mine[0].get("seconds")) is not None:
            row["time"], row["first"] = (
                f"{seconds:.0f} s",
                f"{seconds + mine[0]['compile_s']:.0f} s",
            )
        for key in ("error_mean", "error_p95", "error_max", "gradient"):
            row[key] = _spread([one[key] for one in mine])
        rows.append(row | {f"cost{k}": _cost(mine, mark) for k, mark in enumerate(MARKS)})
    return rows


def _spread(errors: Sequence[float | None]) -> str:
    if None in errors:
        return "-"
    around = f" ± {50 * np.ptp(errors):.3f}" if len(errors) > 1 else ""
    return f"{100 * np.mean(errors):.3f}{around} %"


def _cost(mine: Sequence[Row], mark: float) -> str:
    """Convolutions with G, and seconds, until the mean error is first below the mark."""
    reached = [next((p for p in row["history"] if p[3] <= mark), None) for row in mine]
    if None in reached:
        return "-"
    setup = mine[0].get("setup_s")
    time = "" if setup is None else f" ({reached[0][1] + setup:.0f} s)"
    return f"{np.mean([point[2] for point in reached]):.0f}{time}"


def show(rows: Sequence[Row]) -> str:
    """Return the table of the summary, with the cost of each mean error in ``MARKS``."""
    form = "method {method} | drag error: mean {error_mean} | 95 % {error_p95} | max {error_max}"
    form += " | gradient error {gradient} | G {work:.0f} | time {time} | with compilation {first}"
    for k, mark in enumerate(MARKS):
        form += f" | G (time) to {100 * mark:g} % {{cost{k}}}"
    return columns(form)(summary({"rows": rows}))


OPTIONS = {
    "--seeds": {"type": int, "default": 1, "help": "number of seeds, from 0"},
    "--preset": {"default": "full", "choices": list(PRESETS)},
    "--surrogates": {"type": Path, "default": Path("out/full"), "help": "folder of the trainings"},
}
OPTIONS_3D = {"--surrogates": OPTIONS["--surrogates"] | {"default": Path("out/space_full")}}
BODIES_3D = cases(bodies=[192])  # as many as of the surrogate that ships
STUDIES = {
    "training": Study([Table(seeds, measure, show)], draw=draw, options=OPTIONS),
    "training_space": Study([Table(BODIES_3D, measure, show)], draw=draw, options=OPTIONS_3D),
}
