"""Train a surrogate on where its optima differ from the flow, keeping what it learnt from.

python scripts/refine_surrogate.py --surrogate out/sip --runs out/re40 out/re10 --out out/refined
"""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
from common import Parser, command_line, emit, progress_bar, run
from train_surrogate import save, train_with_bar

from surrogate.training.refine import gaps, joined, samples_around, widened
from shapeopt.runs import load_run
from surrogate.errors import InvalidInput
from surrogate.files import check_target
from surrogate.model.store import RECORD, load_surrogate
from surrogate.training.physics import Samples
from surrogate.training.methods.supervised import supervised

LEARNING_RATE = 1e-3  # a third of a fresh training's: the weights are nearly right


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Find the gaps, solve around them, train on, save."""
    arguments = _parser().parse_args(argv)
    out = Path(arguments.out)
    check_target(out, RECORD)
    if not 1 <= arguments.around <= 1000:
        raise InvalidInput(f"--around {arguments.around}: from 1 to 1000 flows")
    surrogate = load_surrogate(arguments.surrogate)
    records = [load_run(folder) for folder in arguments.runs]
    tolerance = arguments.tolerance
    if tolerance is None:
        tolerance = surrogate.recorded("drag_error_mean")
    before = [gap for gap in gaps(surrogate, records) if gap.error > tolerance]
    if not before:
        raise InvalidInput(
            f"refinement: no run differs from the flow by more than {100 * tolerance:.2g} %; "
            "a smaller --tolerance would find some"
        )
    key = jax.random.fold_in(jax.random.key(surrogate.recorded("seed")), len(before))
    added = samples_around(surrogate.scene, before, arguments.around, key)
    with progress_bar("preparing flows") as progress:
        plan, bench = widened(surrogate, added)
        progress(1.0, f"{plan.samples} bodies, {len(added.reynolds)} of them new")
    trained = train_with_bar(plan, bench, method=supervised(learning_rate=LEARNING_RATE))
    refined = dataclasses.replace(surrogate, network=trained.network)
    closed = {
        "gap_before": max(gap.error for gap in before),
        "gap_after": max(gap.error for gap in gaps(refined, records)),
        "samples_added": len(added.reynolds),
    }
    kept = surrogate.record.get("added")
    everything = joined([*([Samples(*kept)] if kept else []), added])
    result = save(
        plan,
        trained,
        out,
        command_line(),
        bench.setup_s,
        refined_from=str(arguments.surrogate),
        samples=surrogate.recorded("samples"),  # of the first training; the others are in "added"
        added=[part.tolist() for part in everything],
        **closed,
    )
    result |= closed
    text = (
        f"largest gap to the flow {100 * result['gap_before']:.3f} % before, "
        f"{100 * result['gap_after']:.3f} % after {result['samples_added']} more flows; "
        f"unseen bodies {100 * result['drag_error_mean']:.2f} % -> {out}"
    )
    return emit(result, arguments.json, text)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--surrogate", required=True, help="a folder, or pretrained")
    parser.add_argument("--runs", nargs="+", required=True, help="folders of optimize_shape.py")
    parser.add_argument("--tolerance", type=float, help="gap that is let be; else its mean error")
    parser.add_argument("--around", type=int, default=16, help="new flows around every case")
    parser.add_argument("--out", required=True, help="folder of the refined surrogate")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
