"""The whole chain: train every method, optimise bodies, verify, and count when it pays.

python scripts/payoff.py --preset quick --out out/quick
python scripts/payoff.py --preset full --out out/full --json
"""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from common import Parser, command_line, emit, finite, markdown, progress_bar, run
from train_surrogate import train_all

from shapeopt.optimise import Optimum, optimise, optimise_directly
from shapeopt.payoff import Cost, Design, Payoff, payoff
from shapeopt.plot import plot_payoff
from shapeopt.problem import Problem
from shapeopt.render import render_flows
from shapeopt.runs import load_run, save_run
from shapeopt.sheets import before_and_after
from shapeopt.verify import CYLINDER, verify
from surrogate.body import PARAMETERS
from surrogate.store import scene_record

REYNOLDS = {"quick": (1.0, 40.0), "full": (1.0, 3.0, 10.0, 20.0, 40.0)}


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Train, optimise, verify, tabulate, plot."""
    arguments = _parser().parse_args(argv)
    out = Path(arguments.out)
    surrogates, _ = train_all(arguments.preset, arguments.seed, out)
    queries = REYNOLDS[arguments.preset]
    directs, designs = _answer(surrogates, queries, out)
    payoffs = [
        payoff(
            name,
            Cost(s.record["train_s"] + s.record["setup_s"], s.record["green_applications"]),
            (s.record["drag_error_mean"], s.record["drag_error_max"]),
            designs[name],
        )
        for name, s in surrogates.items()
    ]
    best = min(payoffs, key=lambda p: p.gap_mean).method
    pictures = _pictures(payoffs, best, queries, out)
    result = {
        "payoff": [_plain(p) for p in payoffs],
        "designs": {name: [d.drag for d in ds] for name, ds in designs.items()},
        "direct": [optimum.drag for optimum in directs],
        "reynolds": list(queries),
        "best": best,
        **pictures,
    }
    return emit(result, arguments.json, _text(payoffs, designs, directs, queries, pictures))


def _answer(surrogates, queries, out: Path) -> tuple[list[Optimum], dict[str, list[Design]]]:
    """Every query by the direct path and by every surrogate, verified; the first is repeated.

    Compilation is not part of a design's cost, so each path runs once before it is timed.
    """
    scene = next(iter(surrogates.values())).scene
    directs, designs = [], {name: [] for name in surrogates}
    with progress_bar("optimising shapes") as progress:
        progress(0.0, "compiling")
        warm = Problem(scene, queries[0])
        optimise_directly(warm)
        optimise(warm, next(iter(surrogates.values())))
        for k, reynolds in enumerate(queries):
            problem = Problem(scene, reynolds)
            progress(k / len(queries), f"Re {reynolds:g}: direct")
            direct = optimise_directly(problem)
            start = verify(scene, CYLINDER, reynolds)
            directs.append(direct)
            for name, surrogate in surrogates.items():
                progress((k + 0.5) / len(queries), f"Re {reynolds:g}: {name}")
                optimum = optimise(problem, surrogate)
                found = verify(scene, optimum.parameters, reynolds)
                designs[name].append(
                    Design(
                        Cost(optimum.seconds + found.wall_s, found.green_applications),
                        found.cd,
                        Cost(direct.seconds, direct.green_applications),
                        direct.drag,
                    )
                )
                record = {
                    "parameters": dict(zip(PARAMETERS, optimum.parameters.tolist(), strict=True)),
                    "reynolds": reynolds,
                    "cd_start": start.cd,
                    "cd_surrogate": optimum.drag,
                    "cd_verified": found.cd,
                    "cd_direct": direct.drag,
                    "surrogate": str(out / name),
                    "scene": scene_record(scene),
                    "path": optimum.path.tolist(),
                    "command": command_line(),
                }
                save_run(out / f"{name}-re{reynolds:g}", record, optimum.parameters)
        progress(1.0, "verified")
    return directs, designs


def _pictures(payoffs, best, queries, out: Path) -> dict[str, str]:
    with progress_bar("rendering") as progress:
        plot = plot_payoff(payoffs, out / "payoff.png")
        shown = (queries[0], queries[-1])
        rows = [before_and_after(load_run(out / f"{best}-re{reynolds:g}")) for reynolds in shown]
        shapes = render_flows(rows, out / "shapes.png")
        progress(1.0, str(shapes))
    return {"shapes": str(shapes), "plot": str(plot)}


def _plain(p: Payoff) -> dict[str, Any]:
    values = dataclasses.asdict(p)
    return {k: finite(v) if isinstance(v, float) else v for k, v in values.items()}


def _text(payoffs, designs, directs, queries, pictures) -> str:
    """The break-even table and the verified drags, as text."""
    heads = ["method", "error mean / max", "training", "a design", "gap to direct", "pays after"]
    rows = [
        [
            p.method,
            f"{100 * p.drag_error_mean:.2f} / {100 * p.drag_error_max:.2f} %",
            _cost(p.training),
            _cost(p.per_design),
            f"{100 * p.gap_mean:+.2f} % (max {100 * p.gap_max:+.2f} %)",
            f"{p.designs_to_pay_seconds:.1f} designs by time, {p.designs_to_pay_green:.1f} by G",
        ]
        for p in payoffs
    ]
    rows.append(["direct", "", "", _cost(payoffs[0].per_direct), "", ""])
    drags = [
        [
            f"Re {reynolds:g}",
            f"{directs[k].drag:.4f}",
            *(f"{d[k].drag:.4f}" for d in designs.values()),
        ]
        for k, reynolds in enumerate(queries)
    ]
    tables = markdown(heads, rows), markdown(["verified Cd", "direct", *designs], drags)
    return "\n\n".join([*tables, *(f"-> {path}" for path in pictures.values())])


def _cost(cost: Cost) -> str:
    return f"{cost.seconds:.2f} s, {np.round(cost.green_applications):.0f} G"


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--preset", default="quick", choices=["quick", "full"])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", required=True, help="folder for surrogates, runs and pictures")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
