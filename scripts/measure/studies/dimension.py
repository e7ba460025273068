"""Where training is needed: networks against kriging over the number of shape parameters."""

import contextlib
import dataclasses
import functools
import itertools
import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import jax
import numpy as np
from figures import lines
from rivals import Solved, rivals
from studies.training import solved_samples, timed_fit
from study import TINY, Result, Row, Run, Study, Table, columns, values

from shapeopt import Designer, Problem
from shapeopt.payoff.queries import query_stream
from surrogate import Family, Flow, NotConverged, Scene, Surrogate
from surrogate.scene.samples import Samples, held_out_samples, training_samples
from surrogate.training.plan import make_plan
from surrogate.training.record import surrogate_of
from surrogate.training.setup import make_setup

COUNTS = (32, 64, 128, 256)
LED = 64  # bodies of the models by which designs are led
GROWING, KRIGING = "kriging with memory", "gradient-enhanced kriging"
METHODS = ("hig", "sip")
GOALS = (0.003, 0.001)  # mean errors, for which bodies are counted


def family_of(parameters: int) -> Family:
    """Return the default family with more sine modes; ranges of higher modes are smaller."""
    betas = {f"beta{k}": (-0.24 / k, 0.24 / k) for k in range(5, parameters + 1)}
    return Family(**dict(Family().ranges), **betas)


def models(run: Run) -> Iterator[Row]:
    """Yield the cases: every method from more and more bodies, by the number of parameters."""
    for parameters in run.pick((4,), (4, 7, 11)):
        yield {"parameters": parameters, "method": GROWING, "bodies": 0}
        for bodies in run.pick((8,), COUNTS):
            for method in (KRIGING, *METHODS):
                yield {"parameters": parameters, "method": method, "bodies": bodies}


class Ground(NamedTuple):
    """The flows that all models with the same number of parameters share."""

    flow: Flow
    unseen: Samples
    truth: np.ndarray  # drags of the unseen bodies
    solved: Solved  # training bodies with their flows
    work: int  # convolutions with G of these


@functools.lru_cache(maxsize=1)
def ground_of(parameters: int, tiny: bool) -> Ground:
    """Solve the flows of held-out and training bodies, and return them."""
    flow = Flow(Scene(family=family_of(parameters), fidelity=TINY if tiny else "standard"))
    unseen = held_out_samples(flow.scene, 0, 4 if tiny else 64)
    samples = training_samples(flow.scene, 0, 8 if tiny else max(COUNTS))
    return Ground(
        flow,
        unseen,
        np.asarray(flow.solve_all(*unseen, allow_unsteady=True).drag),
        *solved_samples(flow, samples),
    )


def measure(run: Run, parameters: int, method: str, bodies: int) -> Row:
    """Return errors, work and seconds of the fit, and flows per design of some models.

    Designs are by the models of ``LED`` bodies, and by kriging with memory.

    Args:
      run: How the study is run.
      parameters: Number of shape parameters.
      method: Kriging, a network's, or kriging with memory.
      bodies: Number of training bodies.
    """
    flow, unseen, truth, solved, work = ground_of(parameters, run.tiny)
    asked = query_stream(flow.scene, 0, run.pick(1, run.options["queries"]))
    if method == GROWING:
        return _designs(Designer(flow), asked)
    if method == KRIGING:
        part, start = solved.head(bodies), time.process_time()
        predict = rivals()[KRIGING](part)
        row = {"fit_s": time.process_time() - start}
        row["work"] = round(work * bodies / len(solved.observations))
        drags = np.exp(predict(np.asarray(jax.vmap(solved.inputs)(*unseen))))
        designer = Designer(flow)
        designer.memory.observations.extend(part.observations)
    else:
        surrogate, seconds = _trained(run, flow.scene, method, bodies)
        row = {"fit_s": seconds, "work": surrogate.record["green_applications"]}
        drags = np.asarray(jax.vmap(surrogate.network.drag)(*unseen))
        designer = Designer(surrogate)
    errors = np.abs(drags / truth - 1)
    row |= {"mean": errors.mean(), "max": errors.max()}
    return row | (_designs(designer, asked) if bodies == run.pick(8, LED) else {})


def _trained(run: Run, scene: Scene, method: str, count: int) -> tuple[Surrogate, float]:
    """A network, and the seconds that its fit took without flows."""
    plan = make_plan(scene, method, "full", count)
    iterations = run.pick(2, plan.iterations)
    changes = {"held_out": 4, "iterations": iterations, "report_every": max(1, iterations // 5)}
    plan = dataclasses.replace(plan, **changes)
    setup = make_setup(plan)
    trained, seconds = timed_fit(plan, setup)
    return surrogate_of(plan, trained, setup), seconds


def _designs(designer: Designer, asked: Sequence[Problem]) -> Row:
    """Flows per design, of all and of the last half; solved flows are kept between designs."""
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


def _points(rows: Sequence[Row], parameters: int, method: str) -> list[tuple[int, float]]:
    """Bodies and mean errors of one method."""
    mine = [r for r in rows if (r["parameters"], r["method"]) == (parameters, method)]
    return [(row["bodies"], row["mean"]) for row in mine]


def text(result: Result) -> str:
    """Return a table of the number of bodies that each mean error takes."""
    kinds = [(goal, method) for goal in GOALS for method in (KRIGING, *METHODS)]
    form, rows = "parameters {parameters}", result["rows"]
    for k, (goal, method) in enumerate(kinds):
        form += f" | {goal:.1%} by {method} {{needed[{k}]}}"
    return columns(form)(
        [
            {"parameters": n, "needed": [_bodies(_points(rows, n, m), goal) for goal, m in kinds]}
            for n in values(rows, "parameters")
        ]
    )


def _bodies(pairs: Sequence[tuple[int, float]], goal: float) -> str:
    """Bodies for a mean error, by power laws between those measured."""
    if pairs[0][1] <= goal:
        return f"<= {pairs[0][0]}"
    for (few, rough), (many, good) in itertools.pairwise(pairs):
        if good <= goal:
            share = np.log(rough / goal) / np.log(rough / good)
            return f"{few * (many / few) ** share:.0f}"
    return f"> {pairs[-1][0]}"


COLUMNS = columns(
    "parameters {parameters} | method {method} | bodies {bodies} | mean error {mean:.3%}"
    " | largest {max:.2%} | G {work} | seconds of the fit {fit_s:.1f}"
    " | flows per design {flows:.1f} | of the last half {late:.1f}"
    " | largest KKT residual {kkt:.0e} | designs not found {failed}"
)
ERRORS = lines("bodies", "mean", "method", ("bodies", "mean drag error"), "parameters")
OPTIONS = {"--queries": {"type": int, "default": 6, "help": "designs by each model of 64 bodies"}}
TABLE = Table(models, measure, COLUMNS, tiny="all")
STUDIES = {"dimension": Study([TABLE], text, draw=ERRORS, options=OPTIONS)}
