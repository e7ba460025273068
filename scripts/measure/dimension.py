"""Where training is needed: networks against kriging over the number of shape parameters.

python scripts/measure/dimension.py
"""

import contextlib
import dataclasses
import itertools
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from rivals import rivals
from study import TINY, Result, Study, run_study, table
from training import solved_samples, timed_fit

from shapeopt import Designer, Problem
from shapeopt.payoff.queries import query_stream
from shapeopt.render.figures import STYLE, plt, save_figure
from shapeopt.render.tables import markdown
from surrogate import Family, Flow, NotConverged, Scene, Surrogate
from surrogate.training.loop import make_setup
from surrogate.training.plan import make_plan
from surrogate.training.record import surrogate_of
from surrogate.training.samples import held_out_samples, training_samples

PARAMETERS = (4, 7, 11)
COUNTS = (32, 64, 128, 256)
LED = 64  # bodies of the models by which designs are led
KRIGING = "kriging, with slopes"
METHODS = ("hig", "sip")
Row = dict[str, Any]
NONE = dict.fromkeys(("mean", "max", "work", "fit_s", "flows", "late", "kkt", "failed"))


def scene_of(parameters: int, tiny: bool) -> Scene:
    """The default stream around bodies of so many parameters; higher modes have less room."""
    betas = {f"beta{k}": (-0.24 / k, 0.24 / k) for k in range(5, parameters + 1)}
    family = Family(**dict(Family().ranges), **betas)
    return Scene(family=family, fidelity=TINY if tiny else "standard")


def measure(tiny: bool, progress: Callable, queries: int) -> Result:
    """Bodies, errors, seconds of fit, and flows a design of each."""
    rows: list[Row] = []
    chosen = PARAMETERS[:1] if tiny else PARAMETERS
    for k, parameters in enumerate(chosen):
        scene = scene_of(parameters, tiny)
        for row in _rows(scene, tiny, 1 if tiny else queries):
            rows.append(NONE | {"parameters": parameters} | row)
            told = f"{parameters} parameters, {row['bodies']} bodies by {row['method']}"
            progress((k + 0.5) / len(chosen), told)
    return {"queries": queries, "rows": rows}


def _rows(scene: Scene, tiny: bool, queries: int) -> Iterator[Row]:
    flow, counts = Flow(scene), (8,) if tiny else COUNTS
    led = min(LED, max(counts))
    unseen = held_out_samples(scene, 0, 4 if tiny else 64)
    truth, asked = np.asarray(flow.labels(*unseen).drag), query_stream(scene, 0, queries)
    yield {"method": "growing kriging", "bodies": 0} | _designs(Designer(flow), asked)
    solved, work = solved_samples(flow, training_samples(scene, 0, max(counts)))
    z = np.asarray(jax.vmap(solved.inputs)(*unseen))
    for count in counts:
        part, start = solved.head(count), time.process_time()
        predict = rivals()[KRIGING](part)
        row = {"method": KRIGING, "bodies": count, "fit_s": time.process_time() - start}
        row |= _errors(np.exp(predict(z)), truth) | {"work": round(work * count / max(counts))}
        if count == led:
            designer = Designer(flow)
            designer.memory.observations.extend(part.told)
            row |= _designs(designer, asked)
        yield row
        for method in METHODS:
            surrogate, seconds = _trained(scene, method, count, tiny)
            drags = np.asarray(jax.vmap(surrogate.network.drag)(*unseen))
            row = {"method": method, "bodies": count, "fit_s": seconds} | _errors(drags, truth)
            row["work"] = surrogate.record["green_applications"]
            yield row | (_designs(Designer(surrogate), asked) if count == led else {})


def _trained(scene: Scene, method: str, count: int, tiny: bool) -> tuple[Surrogate, float]:
    """A network, and the seconds that its fit took, flows left out."""
    plan = make_plan(scene, method, "full", count)
    iterations = 2 if tiny else plan.iterations
    changes = {"held_out": 4, "iterations": iterations, "report_every": max(1, iterations // 5)}
    plan = dataclasses.replace(plan, **changes)
    bench = make_setup(plan)
    trained, seconds = timed_fit(plan, bench)
    return surrogate_of(plan, trained, bench), seconds


def _errors(drags: np.ndarray, truth: np.ndarray) -> Row:
    errors = np.abs(drags / truth - 1)
    return {"mean": errors.mean(), "max": errors.max()}


def _designs(designer: Designer, asked: Sequence[Problem]) -> Row:
    """Flows a design, what was seen kept from design to design; the last half beside."""
    flows, residuals = [], []
    for problem in asked:
        before = designer.memory.flows
        with contextlib.suppress(NotConverged):
            residuals.append(designer.design(problem).kkt_residual)
        flows.append(designer.memory.flows - before)
    return {
        "flows": np.mean(flows),
        "late": np.mean(flows[len(flows) // 2 :]),
        "kkt": max(residuals, default=None),
        "failed": len(flows) - len(residuals),
    }


def draw(result: Result, path: Path) -> None:
    """Mean error against bodies, one panel a number of parameters."""
    rows = result["rows"]
    counts = list(dict.fromkeys(row["parameters"] for row in rows))
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            1, len(counts), figsize=(12, 4), layout="constrained", sharey=True, squeeze=False
        )
    for axis, parameters in zip(axes[0], counts, strict=True):
        for method in (KRIGING, *METHODS):
            mine = [r for r in rows if (r["parameters"], r["method"]) == (parameters, method)]
            points = [(r["bodies"], 100 * r["mean"]) for r in mine]
            axis.loglog(*zip(*points, strict=True), "o-", ms=3, label=method)
        axis.set_xticks([r["bodies"] for r in mine], [f"{r['bodies']}" for r in mine])
        axis.minorticks_off()
        axis.set(xlabel="bodies", title=f"{parameters} shape parameters")
    axes[0, 0].set(ylabel="mean drag error, %")
    axes[0, 0].legend(frameon=False)
    save_figure(figure, path)


HEADS = "parameters | method | bodies | mean | max | G | seconds of fit | flows a design"
HEADS += " | of the last half | KKT at most | not found"
FORMS = "{parameters} | {method} | {bodies} | {mean:.3%} | {max:.2%} | {work} | {fit_s:.1f}"
FORMS += " | {flows:.1f} | {late:.1f} | {kkt:.0e} | {failed}"
GOALS = (0.003, 0.001)  # mean errors, for which bodies are counted


def tables(result: Result) -> str:
    """All rows, then the bodies that each goal takes."""
    needed = []
    for parameters in dict.fromkeys(row["parameters"] for row in result["rows"]):
        row = {"parameters": parameters}
        for method in (KRIGING, *METHODS):
            mine = [
                (r["bodies"], r["mean"])
                for r in result["rows"]
                if (r["parameters"], r["method"]) == (parameters, method)
            ]
            row |= {f"{method} {goal:g}": _bodies(mine, goal) for goal in GOALS}
        needed.append(row)
    columns = [f"{method} {goal:g}" for goal in GOALS for method in (KRIGING, *METHODS)]
    heads = [f"{goal:.1%} by {method}" for goal in GOALS for method in (KRIGING, *METHODS)]
    whole = table(result["rows"], HEADS, FORMS)
    short = [[f"{r['parameters']}", *(r[column] for column in columns)] for r in needed]
    return f"{whole}\n\n{markdown(['parameters', *heads], short)}"


def _bodies(pairs: Sequence[tuple[int, float]], goal: float) -> str:
    """That a mean error takes, between those measured by power laws."""
    if pairs[0][1] <= goal:
        return f"<= {pairs[0][0]}"
    for (few, rough), (many, good) in itertools.pairwise(pairs):
        if good <= goal:
            share = np.log(rough / goal) / np.log(rough / good)
            return f"{few * (many / few) ** share:.0f}"
    return f"> {pairs[-1][0]}"


OPTIONS = {"--queries": {"type": int, "default": 6, "help": "designs by each model of 64 bodies"}}
STUDY = Study("dimension", measure, tables, draw, OPTIONS)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
