"""The whole chain: train every method, answer a stream of designs, count when training pays.

python scripts/payoff.py --preset quick --out out/quick
python scripts/payoff.py --preset full --out out/full --json

Surrogates that --out holds already are not trained again.
"""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.together import add_devices, use_devices
from shapeopt.payoff.plot import plot_payoff
from shapeopt.payoff.queries import query_stream
from shapeopt.payoff.strategies import compile_all, rivals, trained, trained_with_memory
from shapeopt.payoff.tables import payoff_rows, payoff_tables
from shapeopt.problem.objective import Robust
from shapeopt.problem.problem import Problem
from shapeopt.problem.uncertainty import LogNormal
from shapeopt.render.sheets import before_and_after, render_panels
from shapeopt.render.signature import check_picture
from shapeopt.runs import check_run_folder, load_run, save_run
from shapeopt.search.optimise import optimise
from surrogate.checks import whole_number
from surrogate.devices import choose_devices
from surrogate.errors import InvalidInput
from surrogate.files import check_target, whole_file
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate
from surrogate.progress import progress_bar
from surrogate.scene.scene import Scene
from surrogate.training.plan import PRESETS, SAMPLES_HELP, Plan, compared_plans
from surrogate.training.record import command_line
from surrogate.training.train import train_all

RECORD, PICTURES = "payoff.json", ("payoff.png", "shapes.png")
PLAIN = {"quick": 2, "full": 5}  # queries of least drag without bounds, over the range of Re
QUERIES = {"quick": 5, "full": 50}  # the plain ones included
SAMPLE = 8  # flows by which the direct cost of the robust design is measured


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Train, design by every way, tabulate, plot."""
    arguments = _parser().parse_args(argv)
    devices = choose_devices(use_devices(arguments.devices))
    seeds = whole_number("--seeds", arguments.seeds, 1, 20)
    out, preset = Path(arguments.out), arguments.preset
    check_target(out, RECORD, ("payoff", "queries"), PICTURES, _ours(arguments))
    for k in (0, PLAIN[preset] - 1):
        check_run_folder(out / f"run-{k}")
    for picture in PICTURES:
        check_picture(out / picture, ".png")
    scene = Scene.read(arguments.scene) if arguments.scene else Scene()
    queries = [Problem(scene, reynolds) for reynolds in _plain_reynolds(scene, PLAIN[preset])]
    count = QUERIES[preset] if arguments.queries is None else arguments.queries
    if count < len(queries):
        raise InvalidInput(f"--queries {count}: at least {len(queries)}")
    queries += query_stream(scene, arguments.seed, count - len(queries))
    print(scene.explain(arguments.samples or PRESETS[preset].samples), file=sys.stderr)
    start = time.perf_counter()
    groups = [
        train_all(
            _plans(arguments, scene, arguments.seed + k),
            out / f"seed{arguments.seed + k}" if k else out,
            devices,
        )
        for k in range(seeds)
    ]
    flow, surrogates = Flow(scene), {name: [g[name] for g in groups] for name in groups[0]}
    best = min(groups[0], key=lambda name: groups[0][name].record["drag_error_mean"])
    with progress_bar("compiling"):
        compile_s = compile_all(queries, flow, groups[0][best])
    others = rivals(queries, flow)
    ways = [trained(name, queries, found) for name, found in surrogates.items()]
    ways.append(trained_with_memory(f"{best}, and kriging", queries, surrogates[best]))
    rows = payoff_rows(ways, others, arguments.seed)
    keys = ("flows_per_design", "g_per_design", "s_per_design")
    result = {
        "command": command_line(),
        "seconds": time.perf_counter() - start,
        "compile_s": compile_s,
        "scene": scene.record,
        "payoff": rows,
        "direct": {key: rows[0][key] for key in keys},
        "queries": [_query(problem) for problem in queries],
        "drags": {w.name: [[d.drag for d in row] for row in w.designs] for w in [*others, *ways]},
        "robust": _robust(groups[0][best]),
        "best": best,
        **_pictures([*others, *ways], groups[0][best], queries[: PLAIN[preset]], best, out),
    }
    pictures = "\n\n".join(f"-> {result[name]}" for name in ("shapes", "plot"))
    emit(result, arguments.json, f"{payoff_tables(result)}\n\n{pictures}")
    with whole_file(out / RECORD) as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return result


def _plans(arguments, scene: Scene, seed: int) -> dict[str, Plan]:
    budget = arguments.budget_seconds
    return compared_plans(scene, arguments.preset, arguments.samples, seed, budget)


def _ours(arguments) -> list[str]:
    """Names that an interrupted run leaves in its folder."""
    names = list(_plans(arguments, Scene(), 0))
    names += [f"{name}.checkpoint" for name in names]
    runs = [f"run-{k}" for k in range(9)]
    seeds = [f"seed{arguments.seed + k}" for k in range(arguments.seeds)]
    return [*names, *PICTURES, *runs, *seeds]


def _plain_reynolds(scene: Scene, count: int) -> list[float]:
    """Reynolds numbers over the scene's range, evenly in their logarithm, to two digits."""
    numbers = np.geomspace(*scene.reynolds, count)
    return [float(np.clip(float(f"{value:.2g}"), *scene.reynolds)) for value in numbers]


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


def _pictures(ways, surrogate, queries, best, out: Path) -> dict[str, str]:
    """The plot, and the bodies of the first and the last plain query."""
    with progress_bar("rendering") as progress:
        rows = []
        for k in (0, len(queries) - 1):
            folder = out / f"run-{k}"
            save_run(folder, optimise(queries[k], surrogate), surrogate, str(out / best))
            rows.append(before_and_after(load_run(folder)))
        plot = plot_payoff(ways, out / "payoff.png")
        shapes = render_panels(rows, out / "shapes.png")
        progress(1.0, str(shapes))
    return {"shapes": str(shapes), "plot": str(plot)}


def _query(problem: Problem) -> dict[str, float | None]:
    return {
        "reynolds": problem.objective.nominal,
        "max_length": problem.max_length,
        "min_thickness": problem.min_thickness,
        "max_thickness": problem.max_thickness,
    }


def _parser():
    parser = Parser(__doc__)
    queries = ", ".join(f"{preset}: {count}" for preset, count in QUERIES.items())
    parser.add_argument("--preset", default="quick", choices=list(PRESETS), help="(quick)")
    parser.add_argument("--scene", help="TOML file; unbounded, Re 1 to 40, standard without")
    parser.add_argument(
        "--samples", type=int, help=f"bodies to learn from, from 4 ({SAMPLES_HELP})"
    )
    parser.add_argument(
        "--budget-seconds", type=float, help="train each for this long instead, from 1 s"
    )
    parser.add_argument(
        "--queries", type=int, help=f"designs asked for, from {PLAIN['quick']} ({queries})"
    )
    parser.add_argument("--seed", type=int, default=0, help="the first seed, from 0 (0)")
    parser.add_argument(
        "--seeds", type=int, default=1, help="trainings of every method, 1 to 20 (1)"
    )
    parser.add_argument("--out", required=True, help="folder for surrogates, runs and pictures")
    add_devices(parser)
    return parser
