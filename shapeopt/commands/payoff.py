"""The whole chain: train every method, answer a stream of designs, count when training pays.

python scripts/payoff.py --preset quick --out out/quick
python scripts/payoff.py --preset full --seeds 3 --out out/full --json

Surrogates that --out holds already are not trained again.
"""

import dataclasses
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from shapeopt.commands.cli import Parser, emit, finite
from shapeopt.payoff.payoff import Answer, Bill, Campaign, Payoff, payoff
from shapeopt.payoff.plot import plot_payoff
from shapeopt.payoff.queries import query_stream
from shapeopt.payoff.tables import payoff_tables
from shapeopt.problem.objective import Robust
from shapeopt.problem.problem import Problem
from shapeopt.problem.uncertainty import LogNormal
from shapeopt.render.pictures import render_flows
from shapeopt.render.sheets import before_and_after
from shapeopt.runs import load_run, save_run
from shapeopt.search.optimise import Design, optimise
from shapeopt.search.verify import verify
from surrogate.checks import whole_number
from surrogate.errors import InvalidInput
from surrogate.files import check_target, whole_file
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate
from surrogate.progress import progress_bar
from surrogate.scene.scene import Scene
from surrogate.training.plan import METHODS, PRESETS, make_plan
from surrogate.training.record import command_line
from surrogate.training.train import train_all

RECORD = "payoff.json"
PLAIN = {"quick": 2, "full": 5}  # queries of least drag without bounds, over the range of Re
QUERIES = {"quick": 8, "full": 50}  # the plain ones included
SAMPLE = 8  # flows by which the direct cost of the robust design is measured


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Train, optimise, verify, tabulate, plot."""
    arguments = _parser().parse_args(argv)
    seeds = whole_number("--seeds", arguments.seeds, 1, 20)
    out, preset = Path(arguments.out), arguments.preset
    check_target(out, RECORD, _ours(arguments))
    scene = Scene.read(arguments.scene) if arguments.scene else PRESETS[preset].scene
    queries = [Problem(scene, reynolds) for reynolds in _plain_reynolds(scene, PLAIN[preset])]
    count = QUERIES[preset] if arguments.queries is None else arguments.queries
    if count < len(queries):
        raise InvalidInput(f"--queries {count}: at least {len(queries)}")
    print(scene.explain(arguments.samples or PRESETS[preset].samples), file=sys.stderr)
    start, trained = time.perf_counter(), []
    for seed in range(arguments.seed, arguments.seed + seeds):
        folder = out if seed == arguments.seed else out / f"seed{seed}"

        def plan(method, seed=seed):
            return make_plan(
                scene, method, preset, arguments.samples, seed, arguments.budget_seconds
            )

        trained.append(train_all(plan, folder)[0])
    queries += query_stream(scene, arguments.seed, count - len(queries))
    directs = _answer_directly(queries)
    campaigns = {
        method: [_campaign(group[method], queries, directs, method) for group in trained]
        for method in trained[0]
    }
    payoffs = [payoff(method, found, arguments.seed) for method, found in campaigns.items()]
    best = min(payoffs, key=lambda p: p.gap_mean).method
    result = {
        "command": command_line(),
        "seconds": time.perf_counter() - start,
        "payoff": [_plain(p) for p in payoffs],
        "queries": [_query(problem) for problem in queries],
        "direct": [design.drag for design in directs],
        "designs": {m: [[d.drag for d in c.designs] for c in cs] for m, cs in campaigns.items()},
        "robust": _robust(trained[0][best]),
        "best": best,
        "plain": PLAIN[preset],
        **_pictures(payoffs, trained[0][best], queries[: PLAIN[preset]], best, out),
    }
    with whole_file(out / RECORD) as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    pictures = "\n\n".join(f"-> {result[name]}" for name in ("shapes", "plot"))
    return emit(result, arguments.json, f"{payoff_tables(result)}\n\n{pictures}")


def _ours(arguments) -> list[str]:
    """Names that an interrupted run leaves in its folder."""
    names = [f"{method}{ending}" for method in METHODS for ending in ("", ".checkpoint")]
    pictures = ["payoff.png", "shapes.png", *(f"{m}-{k}" for m in METHODS for k in range(9))]
    seeds = [f"seed{arguments.seed + k}" for k in range(arguments.seeds)]
    return [*names, *pictures, *seeds, "rows.json", "training.json", "training.png"]


def _plain_reynolds(scene: Scene, count: int) -> list[float]:
    """Reynolds numbers over the scene's range, evenly in their logarithm, to two digits."""
    numbers = np.geomspace(*scene.reynolds, count)
    return [float(np.clip(float(f"{value:.2g}"), *scene.reynolds)) for value in numbers]


def _answer_directly(queries: list[Problem]) -> list[Design]:
    """Every query by flows and adjoints; compilation is not part of a design's cost."""
    flow = Flow(queries[0].scene)
    with progress_bar("direct optimisation") as progress:
        progress(0.0, "compiling")
        optimise(queries[0], flow)
        directs = []
        for k, problem in enumerate(queries):
            directs.append(optimise(problem, flow))
            progress((k + 1) / len(queries), f"{k + 1} of {len(queries)} queries")
    return directs


def _campaign(
    surrogate: Surrogate, queries: list[Problem], directs: list[Design], method: str
) -> Campaign:
    """The same queries by a surrogate, every answer verified by a body flow."""
    answers, flow = [], Flow(surrogate.scene)
    with progress_bar(f"designs by {method}") as progress:
        first = optimise(queries[0], surrogate)  # compiles
        flow.solve(
            first.parameters,
            queries[0].objective.nominal,
            estimate=False,
            allow_unsteady=True,
        )
        for k, (problem, direct) in enumerate(zip(queries, directs, strict=True)):
            design = optimise(problem, surrogate)
            found = flow.solve(
                design.parameters, problem.objective.nominal, estimate=False, allow_unsteady=True
            )
            answers.append(
                Answer(
                    Bill(design.seconds + found.seconds, found.green_applications),
                    found.drag,
                    Bill(direct.seconds, direct.green_applications),
                    direct.drag,
                )
            )
            progress((k + 1) / len(queries))
    record = surrogate.record
    bill = Bill(record["train_s"] + record["setup_s"], record["green_applications"])
    return Campaign(bill, record["drag_error_mean"], record["drag_error_max"], answers)


def _robust(surrogate: Surrogate) -> dict[str, Any]:
    """A robust design by the surrogate; what its calls would cost by flows is extrapolated."""
    scene, flow = surrogate.scene, Flow(surrogate.scene)
    middle = float(np.sqrt(np.prod(scene.reynolds)))
    objective = Robust(middle, LogNormal(0.2), tolerance=0.01, level=0.8)
    design = optimise(Problem(scene, objective), surrogate)
    numbers = np.geomspace(*np.clip([0.75 * middle, 1.25 * middle], *scene.reynolds), SAMPLE)
    jax.block_until_ready(flow.slope(design.parameters, numbers[0]))
    start = time.perf_counter()
    answers = jax.block_until_ready([flow.slope(design.parameters, re) for re in numbers])
    seconds = (time.perf_counter() - start) / SAMPLE
    work = float(np.mean([int(answer.green_applications) for answer in answers]))
    return {
        "calls": design.calls,
        "seconds": design.seconds,
        "sampled_flows": SAMPLE,
        "direct_seconds_extrapolated": seconds * design.calls,
        "direct_green_extrapolated": work * design.calls,
    }


def _pictures(payoffs, surrogate, queries, method, out: Path) -> dict[str, str]:
    """The plot, and the bodies of the first and the last plain query."""
    with progress_bar("rendering") as progress:
        rows = []
        for k in (0, len(queries) - 1):
            folder, problem = out / f"{method}-{k}", queries[k]
            design = optimise(problem, surrogate)
            found = verify(problem, design.parameters)
            save_run(folder, problem, design, found, surrogate, str(out / method))
            rows.append(before_and_after(load_run(folder)))
        plot = plot_payoff(payoffs, out / "payoff.png")
        shapes = render_flows(rows, out / "shapes.png")
        progress(1.0, str(shapes))
    return {"shapes": str(shapes), "plot": str(plot)}


def _query(problem: Problem) -> dict[str, float | None]:
    return {
        "reynolds": problem.objective.nominal,
        "max_length": problem.max_length,
        "min_thickness": problem.min_thickness,
    }


def _plain(p: Payoff) -> dict[str, Any]:
    """A payoff for JSON, which has no infinity."""
    record = dataclasses.asdict(p)
    for unit in ("seconds", "green_applications"):
        record[unit] = {name: finite(value) for name, value in record[unit].items()}
    return record


def _parser():
    parser = Parser(__doc__)
    parser.add_argument("--preset", default="quick", choices=list(PRESETS), help="(quick)")
    parser.add_argument("--scene", help="TOML file; the preset's own scene without")
    parser.add_argument("--samples", type=int, help="bodies to learn from, instead of the preset's")
    parser.add_argument("--budget-seconds", type=float, help="train each for this long instead")
    parser.add_argument("--queries", type=int, help="designs asked for, instead of the preset's")
    parser.add_argument("--seed", type=int, default=0, help="the first seed (0)")
    parser.add_argument("--seeds", type=int, default=1, help="trainings of every method (1)")
    parser.add_argument("--out", required=True, help="folder for surrogates, runs and pictures")
    return parser
