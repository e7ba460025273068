"""Train all methods, solve many design problems with each, and count when training pays.

python scripts/payoff.py --preset quick --out out/quick
python scripts/payoff.py --preset full --out out/full --json

Surrogates that are already in --out are not trained again, and the same command after it is done
prints the stored result. The methods: dp, differentiable physics; sip, scale-invariant physics;
hig, half-inverse gradients; supervised, regression on solved flows.
"""

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path

from shapeopt.commands.cli import Parser, emit, resumable
from shapeopt.commands.distributed import add_device_argument, use_devices
from shapeopt.payoff.break_even import Strategy
from shapeopt.payoff.plot import plot_payoff
from shapeopt.payoff.queries import plain_queries, query_stream, robust_objective
from shapeopt.payoff.strategies import (
    comparable,
    compile_all,
    rivals,
    trained,
    trained_with_memory,
)
from shapeopt.payoff.tables import payoff_rows, payoff_tables
from shapeopt.problem.problem import Problem
from shapeopt.records import load_run
from shapeopt.render.sheets import before_and_after, render_panels
from shapeopt.runs import check_run_folder, save_run
from shapeopt.search.optimise import optimise
from surrogate.checks import whole_number
from surrogate.devices import choose_devices
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject, check_target, strict_json, whole_file
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate
from surrogate.progress import print_message, progress_bar
from surrogate.repeats import check_settings
from surrogate.scene.samples import LARGEST_SEED
from surrogate.scene.scene import Scene
from surrogate.training.plan import PRESETS, SAMPLES_HELP, Plan, compared_plans
from surrogate.training.train import train_all
from surrogate.versions import command_line

RECORD, PICTURES = "payoff.json", {"shapes": "shapes.png", "plot": "payoff.png"}
PLAIN = {"quick": 2, "full": 5}  # design problems without constraints, over the range of Re
QUERIES = {"quick": 5, "full": 50}  # design problems in all


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, train, design by every strategy, tabulate the costs and plot them."""
    arguments = _parser().parse_args(argv)
    devices = choose_devices(use_devices(arguments.devices))
    seeds = whole_number("--seeds", arguments.seeds, 1, 20)
    whole_number("--seed", arguments.seed, 0, LARGEST_SEED - seeds)
    out, preset = Path(arguments.out), arguments.preset
    check_target(out, RECORD, ("payoff", "queries"), _own_names(arguments))
    for k in (0, PLAIN[preset] - 1):
        check_run_folder(out / f"run-{k}")
    scene = Scene.read(arguments.scene) if arguments.scene else Scene()
    count = QUERIES[preset] if arguments.queries is None else arguments.queries
    if count < PLAIN[preset]:
        raise InvalidInput(f"--queries {count}: at least {PLAIN[preset]}")
    settings = _settings(arguments, scene, seeds, count)
    if (stored := _stored(out, settings, arguments.overwrite)) is not None:
        print_message(f"{out}: this payoff is done already; --overwrite repeats it")
        return _emit(stored, arguments.json)
    queries = plain_queries(scene, PLAIN[preset])
    queries += query_stream(scene, arguments.seed, count - len(queries))
    plans = [_plans(arguments, scene, arguments.seed + k) for k in range(seeds)]
    print_message(scene.explain(arguments.samples or PRESETS[preset].samples))
    start = time.perf_counter()
    with resumable():
        groups = [
            train_all(
                plans[k],
                out / f"seed{arguments.seed + k}" if k else out,
                devices,
                arguments.overwrite,
            )
            for k in range(seeds)
        ]
    flow, surrogates = Flow(scene), {name: [g[name] for g in groups] for name in groups[0]}
    best = min(groups[0], key=lambda name: groups[0][name].record["drag_error_mean"])
    robust = _robust(groups[0][best])
    compile_all(queries, flow, groups[0][best])
    others = rivals(queries, flow)
    own = [trained(name, queries, found) for name, found in surrogates.items()]
    own.append(trained_with_memory(f"{best}, and kriging", queries, surrogates[best]))
    strategies, missing = comparable([*others, *own])
    others, own = strategies[: len(others)], strategies[len(others) :]
    rows = payoff_rows(own, others, arguments.seed)
    left_out = [{**_query(queries[k]), "by": name, "reason": why} for k, name, why in missing]
    unanswered = {one.query for one in missing}
    result = {
        "command": command_line(),
        "seconds": time.perf_counter() - start,
        "scene": scene.record,
        "settings": settings,
        "payoff": rows,
        "queries": [_query(q) for k, q in enumerate(queries) if k not in unanswered],
        "left_out": left_out,
        "drags": {s.name: [[d.drag for d in row] for row in s.designs] for s in strategies},
        "robust": robust,
        "best": best,
        **_places(out),
    }
    for picture in PICTURES.values():  # of an earlier payoff
        (out / picture).unlink(missing_ok=True)
    with whole_file(out / RECORD) as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    try:
        _draw(strategies, groups[0][best], queries[: PLAIN[preset]], best, out)
    finally:  # the numbers are shown even if the pictures fail
        _emit(result, arguments.json)
    return result


def _emit(result: JsonObject, as_json: bool) -> JsonObject:
    pictures = "\n\n".join(f"-> {result[name]}" for name in PICTURES)
    return emit(result, as_json, f"{payoff_tables(result)}\n\n{pictures}")


def _settings(arguments: argparse.Namespace, scene: Scene, seeds: int, count: int) -> JsonObject:
    """Return the settings that define a payoff."""
    return {
        **scene.record,
        "preset": arguments.preset,
        "samples": arguments.samples or PRESETS[arguments.preset].samples,
        "budget_seconds": arguments.budget_seconds,
        "queries": count,
        "seed": arguments.seed,
        "seeds": seeds,
    }


def _stored(out: Path, settings: JsonObject, overwrite: bool) -> JsonObject | None:
    """Return the payoff that the folder holds if it is of these settings and whole, else None.

    Raises:
      InvalidInput: it is of others, and ``overwrite`` is not set.
    """
    if overwrite or not (out / RECORD).is_file():
        return None
    stored = strict_json((out / RECORD).read_text(encoding="utf-8"))
    check_settings(out, "payoff", stored.get("settings"), settings)
    complete = all((out / name).is_file() for name in PICTURES.values())
    return stored | _places(out) if complete else None


def _places(out: Path) -> dict[str, str]:
    """Return the paths of the pictures of a payoff."""
    return {name: str(out / file) for name, file in PICTURES.items()}


def _plans(arguments: argparse.Namespace, scene: Scene, seed: int) -> dict[str, Plan]:
    budget = arguments.budget_seconds
    return compared_plans(scene, arguments.preset, seed, arguments.samples, budget)


def _own_names(arguments: argparse.Namespace) -> list[str]:
    """Return the names that an interrupted command leaves in its folder."""
    names = list(_plans(arguments, Scene(), 0))
    names += [f"{name}.checkpoint" for name in names]
    runs = [f"run-{k}" for k in range(9)]
    seeds = [f"seed{arguments.seed + k}" for k in range(arguments.seeds)]
    return [*names, *PICTURES.values(), *runs, *seeds]


def _robust(surrogate: Surrogate) -> JsonObject:
    """Return the cost of a robust design by the surrogate alone."""
    objective = robust_objective(surrogate.scene)
    design = optimise(Problem(surrogate.scene, objective), surrogate)
    return {"calls": design.calls, "seconds": design.seconds}


def _draw(
    strategies: list[Strategy], surrogate: Surrogate, queries: list[Problem], best: str, out: Path
) -> None:
    """Plot the cost, and draw the bodies of the first and the last query without constraints."""
    with progress_bar("rendering") as progress:
        rows = []
        for k in (0, len(queries) - 1):
            folder = out / f"run-{k}"
            save_run(folder, optimise(queries[k], surrogate), surrogate, str(out / best))
            rows.append(before_and_after(load_run(folder)))
        plot_payoff(strategies, out / PICTURES["plot"])
        shapes = render_panels(rows, out / PICTURES["shapes"])
        progress(1.0, str(shapes))


def _query(problem: Problem) -> JsonObject:
    objective = type(problem.objective).__name__
    query = {"objective": objective, "reynolds": problem.objective.nominal}
    return query | problem.constraints


def _parser() -> Parser:
    parser = Parser(__doc__)
    queries = ", ".join(
        f"{preset}: from {PLAIN[preset]}, {count} by default" for preset, count in QUERIES.items()
    )
    add = parser.add_argument
    add(
        "--preset",
        default="quick",
        choices=list(PRESETS),
        help="number of samples and queries (quick)",
    )
    add("--scene", help="TOML file (unbounded, Re 1 to 40, fidelity standard)")
    add("--samples", type=int, help=f"training samples, from 4 ({SAMPLES_HELP})")
    add("--budget-seconds", type=float, help="train each for this time instead, from 1 s")
    add("--queries", type=int, help=f"design problems ({queries})")
    add("--seed", type=int, default=0, help="the first seed, from 0 (0)")
    add("--seeds", type=int, default=1, help="trainings of every method, 1 to 20 (1)")
    add("--out", required=True, help="folder for surrogates, runs and pictures")
    add(
        "--overwrite",
        action="store_true",
        help="replace a payoff or trainings of other settings; equal trainings are kept",
    )
    add_device_argument(parser)
    return parser
