"""The whole chain: train every method, answer a stream of designs, count when training pays.

    python scripts/payoff.py --preset quick --out out/quick
    python scripts/payoff.py --preset full --seeds 3 --out out/full --json

Surrogates that --out holds already (measure_training.py makes the same) are not trained again.
"""

import dataclasses
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from common import Parser, command_line, emit, finite, markdown, progress_bar, run
from train_surrogate import train_all

from shapeopt.problem.objective import Robust
from shapeopt.search.optimise import Optimum, optimise, optimise_directly
from shapeopt.payoff.payoff import BreakEven, Campaign, Cost, Design, Payoff, payoff
from shapeopt.payoff.plot import plot_payoff
from shapeopt.problem.problem import Problem
from shapeopt.payoff.queries import query_stream
from shapeopt.render.pictures import render_flows
from shapeopt.runs import load_run, save_run
from shapeopt.render.sheets import before_and_after
from shapeopt.problem.uncertainty import LogNormal
from shapeopt.search.verify import CYLINDER, verify
from surrogate.body.family import PARAMETERS
from surrogate.errors import InvalidInput
from surrogate.files import whole_file
from surrogate.flow.flow import family_drag_and_shape_gradient
from surrogate.flow.solver.steady import preparation_cost
from surrogate.model.store import Surrogate, scene_record
from surrogate.training.physics import scene_domain

PLAIN = {"quick": (1.0, 40.0), "full": (1.0, 3.0, 10.0, 20.0, 40.0)}  # least drag, no bounds
QUERIES = {"quick": 8, "full": 50}  # the plain ones included
SAMPLE = 8  # flows by which the direct cost of the robust design is measured


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Train, optimise, verify, tabulate, plot."""
    arguments = _parser().parse_args(argv)
    if not 1 <= arguments.seeds <= 20:
        raise InvalidInput(f"--seeds {arguments.seeds}: from 1 to 20")
    out, name = Path(arguments.out), arguments.preset
    trained = [
        train_all(name, arguments.seed + k, out if k == 0 else out / f"seed{arguments.seed + k}")[0]
        for k in range(arguments.seeds)
    ]
    scene = next(iter(trained[0].values())).scene
    queries = [Problem(scene, reynolds) for reynolds in PLAIN[name]]
    queries += query_stream(scene, arguments.seed, QUERIES[name] - len(queries))
    directs = _answer_directly(queries)
    campaigns = {
        method: [_campaign(group[method], queries, directs, method) for group in trained]
        for method in trained[0]
    }
    payoffs = [payoff(method, found, arguments.seed) for method, found in campaigns.items()]
    best = min(payoffs, key=lambda p: p.gap_mean).method
    robust = _robust(trained[0][best])
    plain = len(PLAIN[name])
    pictures = _pictures(payoffs, trained[0][best], queries[:plain], directs, best, out)
    result = {
        "payoff": [_plain(p) for p in payoffs],
        "queries": [_query(problem) for problem in queries],
        "direct": [optimum.drag for optimum in directs],
        "designs": {m: [[d.drag for d in c.designs] for c in cs] for m, cs in campaigns.items()},
        "robust": robust,
        "best": best,
        **pictures,
    }
    with whole_file(out / "payoff.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    text = _text(payoffs, campaigns, directs, queries[:plain], robust, pictures)
    return emit(result, arguments.json, text)


def _answer_directly(queries: list[Problem]) -> list[Optimum]:
    """Every query by flows and adjoints; compilation is not part of a design's cost."""
    with progress_bar("direct optimisation") as progress:
        progress(0.0, "compiling")
        optimise_directly(queries[0])
        directs = []
        for k, problem in enumerate(queries):
            directs.append(optimise_directly(problem))
            progress((k + 1) / len(queries), f"{k + 1} of {len(queries)} queries")
    return directs


def _campaign(
    surrogate: Surrogate, queries: list[Problem], directs: list[Optimum], method: str
) -> Campaign:
    """The same queries by a surrogate, every answer verified by a body flow."""
    designs = []
    optimise(queries[0], surrogate)
    verify(surrogate.scene, CYLINDER, queries[0].objective.nominal)
    with progress_bar(f"designs by {method}") as progress:
        for k, (problem, direct) in enumerate(zip(queries, directs, strict=True)):
            optimum = optimise(problem, surrogate)
            found = verify(surrogate.scene, optimum.parameters, problem.objective.nominal)
            designs.append(
                Design(
                    Cost(optimum.seconds + found.wall_s, found.green_applications),
                    found.cd,
                    Cost(direct.seconds, direct.green_applications),
                    direct.drag,
                )
            )
            progress((k + 1) / len(queries))
    record = surrogate.record
    bill = Cost(record["train_s"] + record["setup_s"], record["green_applications"])
    return Campaign(bill, record["drag_error_mean"], record["drag_error_max"], designs)


def _robust(surrogate: Surrogate) -> dict[str, Any]:
    """A robust design by the surrogate; what its calls would cost by flows is extrapolated."""
    objective = Robust(20.0, LogNormal(0.2), tolerance=0.01, level=0.8)
    optimum = optimise(Problem(surrogate.scene, objective), surrogate)
    domain = scene_domain(surrogate.scene)
    body = jnp.asarray(optimum.parameters)
    numbers = [jnp.asarray(re) for re in np.linspace(15.0, 25.0, SAMPLE)]
    jax.block_until_ready(family_drag_and_shape_gradient(domain, body, numbers[0]))
    start = time.perf_counter()
    answers = [family_drag_and_shape_gradient(domain, body, re) for re in numbers]
    jax.block_until_ready(answers)
    seconds = (time.perf_counter() - start) / SAMPLE
    work = np.mean([int(info.products) for *_, info in answers]) + preparation_cost(domain)
    return {
        "calls": optimum.calls,
        "seconds": optimum.seconds,
        "sampled_flows": SAMPLE,
        "direct_seconds_extrapolated": seconds * optimum.calls,
        "direct_green_extrapolated": float(work * optimum.calls),
    }


def _pictures(payoffs, surrogate, queries, directs, method, out: Path) -> dict[str, str]:
    """The plot, and the bodies of the first and the last plain query."""
    with progress_bar("rendering") as progress:
        rows = []
        for k in (0, len(queries) - 1):
            folder = _save(surrogate, queries[k], directs[k], out, f"{method}-{k}")
            rows.append(before_and_after(load_run(folder)))
        plot = plot_payoff(payoffs, out / "payoff.png")
        shapes = render_flows(rows, out / "shapes.png")
        progress(1.0, str(shapes))
    return {"shapes": str(shapes), "plot": str(plot)}


def _save(surrogate: Surrogate, problem: Problem, direct: Optimum, out: Path, name: str) -> Path:
    """The run of one query, as optimize_shape.py leaves it."""
    optimum, reynolds = optimise(problem, surrogate), problem.objective.nominal
    record = {
        "parameters": dict(zip(PARAMETERS, optimum.parameters.tolist(), strict=True)),
        "reynolds": reynolds,
        "cd_start": verify(surrogate.scene, CYLINDER, reynolds).cd,
        "cd_surrogate": optimum.drag,
        "cd_verified": verify(surrogate.scene, optimum.parameters, reynolds).cd,
        "cd_direct": direct.drag,
        "surrogate": str(out / surrogate.record["method"]),
        "scene": scene_record(surrogate.scene),
        "path": optimum.path.tolist(),
        "command": command_line(),
    }
    save_run(out / name, record, optimum.parameters)
    return out / name


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


def _text(payoffs, campaigns, directs, plain, robust, pictures) -> str:
    """The break-even table, the verified drags of the plain queries, and the robust design."""
    heads = ["method", "error mean / max", "training", "a design", "gap to direct"]
    heads += ["pays after designs, by time", "by G"]
    rows = [
        [
            p.method,
            f"{100 * p.drag_error_mean:.2f} / {100 * p.drag_error_max:.2f} %",
            _cost(p.training),
            _cost(p.per_design),
            f"{100 * p.gap_mean:+.3f} % (max {100 * p.gap_max:+.2f} %)",
            _break_even(p.seconds),
            _break_even(p.green_applications),
        ]
        for p in payoffs
    ]
    rows.append(["direct", "", "", _cost(payoffs[0].per_direct), "", "", ""])
    drags = [
        [
            f"Re {problem.objective.nominal:g}",
            f"{directs[k].drag:.4f}",
            *(f"{group[0].designs[k].drag:.4f}" for group in campaigns.values()),
        ]
        for k, problem in enumerate(plain)
    ]
    hours = robust["direct_seconds_extrapolated"] / 3600
    tables = [
        markdown(heads, rows),
        f"{len(directs)} queries; in brackets 95 % intervals",
        markdown(["verified Cd", "direct", *campaigns], drags),
        f"robust design: {robust['calls']} drags in {robust['seconds']:.2f} s; by flows and "
        f"adjoints {hours:.1f} hours, extrapolated from {robust['sampled_flows']}",
    ]
    return "\n\n".join([*tables, *(f"-> {path}" for path in pictures.values())])


def _break_even(found: BreakEven) -> str:
    return f"{found.designs:.1f} ({found.low:.1f} to {found.high:.1f})"


def _cost(cost: Cost) -> str:
    return f"{cost.seconds:.2f} s, {np.round(cost.green_applications):.0f} G"


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--preset", default="quick", choices=["quick", "full"])
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument("--seeds", type=int, default=1, help="trainings of every method")
    parser.add_argument("--out", required=True, help="folder for surrogates, runs and pictures")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
