"""Train a drag surrogate: dp, sip, hig or supervised. Interrupted, the same command resumes.

python scripts/train_surrogate.py --method sip --preset quick --out out/sip
python scripts/train_surrogate.py --method hig --preset full --seed 1 --out out/hig --json
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from common import Parser, command_line, emit, progress_bar, run, say

from surrogate.errors import InvalidInput
from surrogate.files import check_target
from surrogate.model.store import RECORD, Surrogate, load_surrogate, save_surrogate
from surrogate.training.loop import Bench, Trained, make_bench, train
from surrogate.training.methods.method import Method
from surrogate.training.presets import METHODS, Plan, preset


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, train, save."""
    arguments = _parser().parse_args(argv)
    plan = preset(arguments.method, arguments.preset, arguments.seed, arguments.budget_seconds)
    out = Path(arguments.out)
    check_target(out, RECORD)
    place = out.resolve()
    say(plan.scene.explain())
    with progress_bar("preparing flows") as progress:
        bench = make_bench(plan)
        progress(1.0, f"{plan.samples} bodies, {plan.held_out} held out, {bench.setup_s:.0f} s")
    trained = train_with_bar(plan, bench, place.with_name(place.name + ".checkpoint.npz"))
    result = save(plan, trained, out, command_line(), bench.setup_s)
    text = (
        f"{plan.method}: drag error mean {100 * result['drag_error_mean']:.2f} %, max "
        f"{100 * result['drag_error_max']:.2f} % on {plan.held_out} unseen bodies after "
        f"{result['green_applications']} applications of G, {result['train_s']:.1f} s -> {out}"
    )
    return emit(result, arguments.json, text)


def train_with_bar(
    plan: Plan,
    bench: Bench,
    checkpoint: Path | None = None,
    method: Method | None = None,
    title: str | None = None,
) -> Trained:
    """Train with progress on stderr; ``method`` and ``title`` replace the plan's own."""
    with progress_bar(f"training {title or plan.method}") as progress:

        def report(point, done):
            progress(
                done,
                f"step {point.iteration}: error mean {100 * point.error_mean:.2f} % "
                f"max {100 * point.error_max:.2f} %, G {point.green_applications}",
            )

        trained = train(plan, bench, checkpoint, report, method=method)
    if trained.stopped:
        say(f"{plan.method}: {trained.stopped}; the last good weights are kept")
    return trained


def save(
    plan: Plan, trained: Trained, out: Path, command: str, setup_s: float, **more: Any
) -> dict[str, Any]:
    """Save the surrogate with its record, and ``more`` in it; returns what the command reports."""
    last = trained.history[-1]
    result = {
        "method": plan.method,
        "drag_error_mean": last.error_mean,
        "drag_error_max": last.error_max,
        "green_applications": last.green_applications,
        "train_s": last.seconds,
        "weights": int(trained.network.weights.size),
        "out": str(out),
    }
    record = {
        **result,
        "command": command,
        "setup_s": setup_s,
        "seed": plan.seed,
        "samples": plan.samples,
        "held_out": plan.held_out,
        "iterations": last.iteration,
        "failed_samples": last.failed,
        "stopped": trained.stopped,
        "history": [list(point[:5]) for point in trained.history],
        **more,
    }
    save_surrogate(out, Surrogate(trained.network, plan.scene, record))
    return result


def train_all(name: str, seed: int, out: Path) -> tuple[dict[str, Surrogate], Bench]:
    """One surrogate per method from one bench, in ``out``; those already trained are loaded.

    Raises:
      InvalidInput: a folder holds something else, or a surrogate of another plan.
    """
    plans = {method: preset(method, name, seed) for method in METHODS}
    for method in plans:
        check_target(out / method, RECORD)
    with progress_bar("preparing flows") as progress:
        bench = make_bench(plans["dp"])
        progress(1.0, f"{bench.physics.count} bodies in {bench.setup_s:.0f} s")
    surrogates = {}
    for method, plan in plans.items():
        if not (out / method / RECORD).is_file():
            trained = train_with_bar(plan, bench, out / f"{method}.checkpoint.npz")
            save(plan, trained, out / method, command_line(), bench.setup_s)
        surrogates[method] = load_surrogate(out / method)
        if not is_of(plan, surrogates[method]):
            raise InvalidInput(
                f"{out / method}: is of another method, preset or seed; choose another --out"
            )
    return surrogates, bench


def is_of(plan: Plan, surrogate: Surrogate) -> bool:
    """Whether this is what the plan's training leaves: a whole one, and not refined since."""
    record = surrogate.record
    asked = (plan.method, plan.samples, plan.held_out, plan.seed)
    found = tuple(record.get(key) for key in ("method", "samples", "held_out", "seed"))
    whole = record.get("stopped") or record.get("iterations") == plan.iterations
    return found == asked and surrogate.scene == plan.scene and whole and "added" not in record


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--method", required=True, help=", ".join(METHODS))
    parser.add_argument("--preset", default="quick", choices=["quick", "full"])
    parser.add_argument("--budget-seconds", type=float, help="train for this long instead")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", required=True, help="folder of the surrogate")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
