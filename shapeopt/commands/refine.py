"""Train a surrogate on where its optima differ from the flow, keeping what it learnt from.

python scripts/refine_surrogate.py --surrogate out/sip --runs out/re40 out/re10 --out out/refined
"""

from collections.abc import Sequence
from typing import Any

from shapeopt.commands.cli import Parser, emit
from shapeopt.runs import load_run, verified_bodies
from surrogate.errors import InvalidInput
from surrogate.model.store import check_surrogate_folder, load
from surrogate.scene.scene import Scene
from surrogate.training.refine import refine


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Find the gaps, solve around them, train on, save."""
    arguments = _parser().parse_args(argv)
    check_surrogate_folder(arguments.out)
    surrogate = load(arguments.surrogate)
    records = [load_run(folder) for folder in arguments.runs]
    if any(Scene.of(record["scene"]) != surrogate.scene for record in records):
        raise InvalidInput("refinement: a run is of another scene than the surrogate's")
    bodies = [body for record in records for body in verified_bodies(record)]
    found = refine(surrogate, bodies, arguments.tolerance, arguments.around, arguments.out)
    keys = ("method", "drag_error_mean", "drag_error_max", "green_applications", "train_s")
    keys += ("weights", "gap_before", "gap_after", "samples_added")
    result = {key: found.record[key] for key in keys} | {"out": arguments.out}
    text = (
        f"largest gap to the flow {100 * result['gap_before']:.3f} % before, "
        f"{100 * result['gap_after']:.3f} % after {result['samples_added']} more flows; "
        f"unseen bodies {100 * result['drag_error_mean']:.2f} % -> {arguments.out}"
    )
    return emit(result, arguments.json, text)


def _parser():
    parser = Parser(__doc__)
    parser.add_argument("--surrogate", required=True, help="a folder, or pretrained")
    parser.add_argument("--runs", nargs="+", required=True, help="folders of optimize_shape.py")
    parser.add_argument("--tolerance", type=float, help="gap that is let be (its mean error)")
    parser.add_argument("--around", type=int, default=16, help="new flows around a case (16)")
    parser.add_argument("--out", required=True, help="folder of the refined surrogate")
    return parser
