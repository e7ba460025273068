"""Train a drag surrogate: dp, sip, hig or supervised. Interrupted, the same command resumes.

python scripts/train_surrogate.py --method sip --preset quick --out out/sip
python scripts/train_surrogate.py --method hig --scene tunnel.toml --samples 64 --out out/hig --json
python scripts/train_surrogate.py --method hig --preset full --devices 16 --out out/hig

On many machines the same command on each, --coordinator HOST:PORT --processes N --process K added;
under Slurm or Open MPI without them.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.together import add_arguments, as_one, come_together, is_parent, watch
from surrogate.devices import choose_devices
from surrogate.model.store import check_surrogate_folder
from surrogate.processes import first
from surrogate.scene.scene import Scene
from surrogate.training.forecast import forecast
from surrogate.training.plan import METHODS, PRESETS, SAMPLES_HELP, make_plan
from surrogate.training.train import carry_out


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, explain, train, save, compare with what was foreseen."""
    a = _parser().parse_args(argv)
    if is_parent(a):
        watch("train", sys.argv[1:] if argv is None else argv)
        return {}
    count = come_together(a)
    scene = Scene.read(a.scene) if a.scene else None
    plan = make_plan(scene, a.method, a.preset, a.samples, a.seed, a.budget_seconds, a.published)
    out, devices = Path(a.out), choose_devices(count, a.lanes)
    check_surrogate_folder(out)
    foreseen = forecast(plan)
    seconds = plan.budget_s or foreseen.flow_s / devices.count + foreseen.network_s
    if first():
        print(plan.scene.explain(plan.samples + plan.held_out), file=sys.stderr)
        print(
            f"This training: about {foreseen.green_applications:,.0f} applications of G and "
            f"{seconds:.0f} s ({foreseen.flow_s:.0f} s of flows by one device, "
            f"{foreseen.network_s:.0f} s of network) on {devices.count} device"
            f"{'' if devices.count == 1 else 's'}.",
            file=sys.stderr,
        )
    with as_one():
        record = carry_out(plan, out, first(), devices).record
    keys = ("method", "drag_error_mean", "drag_error_max", "green_applications", "train_s")
    result = {key: record[key] for key in (*keys, "weights", "compile_s")}
    result |= {"out": str(out), "foreseen_g": foreseen.green_applications, "foreseen_s": seconds}
    text = (
        f"{plan.method}: drag error mean {100 * result['drag_error_mean']:.2f} %, max "
        f"{100 * result['drag_error_max']:.2f} % on {plan.held_out} unseen bodies after "
        f"{result['green_applications']} applications of G (foreseen "
        f"{foreseen.green_applications:.0f}), {record['setup_s'] + result['train_s']:.1f} s "
        f"(foreseen {seconds:.1f}) and {record['compile_s']:.1f} s of compiling -> {out}"
    )
    return emit(result, a.json, text) if first() else result


def _parser():
    parser = Parser(__doc__)
    parser.add_argument("--method", required=True, help=", ".join(METHODS))
    parser.add_argument("--scene", help="TOML file; unbounded, Re 1 to 40, standard without")
    parser.add_argument(
        "--samples", type=int, help=f"bodies to learn from, from 4 ({SAMPLES_HELP})"
    )
    parser.add_argument("--preset", default="quick", choices=list(PRESETS), help="(quick)")
    parser.add_argument(
        "--budget-seconds", type=float, help="train for this long instead, from 1 s"
    )
    parser.add_argument(
        "--published", action="store_true", help="the method as published, not at its best"
    )
    parser.add_argument("--seed", type=int, default=0, help="of samples and weights, from 0 (0)")
    parser.add_argument("--out", required=True, help="folder of the surrogate")
    add_arguments(parser)
    return parser
