"""Train a drag surrogate; the same command resumes an interrupted training, or says it is done.

python scripts/train_surrogate.py --method sip --preset quick --out out/sip
python scripts/train_surrogate.py --method hig --scene scripts/tunnel.toml --samples 64 \\
    --out out/hig --json
python scripts/train_surrogate.py --method hig --preset full --devices 16 --out out/hig

Methods:
  dp          differentiable physics: Adam on a loss on the flow, by the solver's adjoint
  sip         scale-invariant physics: regression on labels that Newton steps of the solver improve
  hig         half-inverse gradients: updates by a half inverted Jacobian of the residuals
  supervised  supervised regression: each sample's flow is solved once and the network fitted

On several machines: the same command on each, with --coordinator HOST:PORT --processes N
--process K added, or under Slurm or Open MPI without these.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from shapeopt.commands.cli import Parser, emit, resumable
from shapeopt.commands.distributed import (
    add_distributed_arguments,
    exit_when_disconnected,
    initialise,
    needs_supervision,
    supervise,
)
from surrogate.devices import Devices, choose_devices
from surrogate.files import JsonObject
from surrogate.model.card import recorded_errors
from surrogate.model.outputs import SYMBOLS
from surrogate.model.store import load, warn_of_inaccuracy
from surrogate.model.surrogate import Surrogate
from surrogate.processes import first
from surrogate.progress import duration, print_message
from surrogate.scene.scene import Scene
from surrogate.training.forecast import forecast
from surrogate.training.plan import HELD_OUT_HELP, METHODS, PRESETS, SAMPLES_HELP, Plan, make_plan
from surrogate.training.stored import stored_training
from surrogate.training.train import is_measured, train_plan

KEYS = (
    *("method", "green_applications", "train_s", "weights"),
    *("compile_s", "foreseen_g", "foreseen_s", "unsolved_samples"),
)


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, train and save a surrogate, and report its errors and cost."""
    a = _parser().parse_args(argv)
    if needs_supervision(a):
        with resumable():
            supervise("train", sys.argv[1:] if argv is None else argv)
        return {}
    count = initialise(a)
    scene = Scene.read(a.scene) if a.scene else None
    numbers = a.preset, a.samples, a.seed, a.budget_seconds, a.published, a.held_out
    infill = load(a.infill_from) if a.infill_from else None
    plan = make_plan(scene, a.method, *numbers, infill, a.width)
    out, devices = Path(a.out), choose_devices(count, a.device_batch)
    with exit_when_disconnected(), resumable():
        stored = stored_training(plan, out, a.overwrite)
        if stored is None or a.overwrite:
            surrogate = _train(plan, out, devices, a.overwrite)
        elif is_measured(stored, plan):
            surrogate = stored
        else:
            surrogate = train_plan(plan, out, first(), devices)
    if not first():
        return {}
    if surrogate is stored:
        print_message(f"{out}: this training is done already; --overwrite repeats it")
    warn_of_inaccuracy(surrogate, str(out))
    record = surrogate.record
    errors = recorded_errors(record)
    result = {key: record.get(key) for key in KEYS}
    result |= {f"{name}_error_{k}": e[k] for name, e in errors.items() for k in ("mean", "max")}
    result |= {"out": str(out), "warning": surrogate.inaccuracy}
    forecasts = [record.get("foreseen_g"), record.get("foreseen_s")]
    work, seconds = ("" if f is None else f" (forecast {f:.0f})" for f in forecasts)
    text = (
        f"{plan.method}: {_errors(errors)} on {surrogate.unseen} unseen bodies after "
        f"{result['green_applications']} convolutions{work}, "
        f"{record['setup_s'] + result['train_s']:.1f} s{seconds} and "
        f"{record.get('compile_s', 0.0):.1f} s of compiling -> {out}"
    )
    return emit(result, a.json, text)


def _errors(errors: dict[str, dict[str, float]]) -> str:
    """Return the mean and the largest error of every load as text."""
    words = (
        f"{SYMBOLS[name]} {100 * e['mean']:.2f} % on average, {100 * e['max']:.2f} % at most"
        for name, e in errors.items()
    )
    return f"error of {'; of '.join(words)}{' (all over Cd)' if len(errors) > 1 else ''}"


def _train(plan: Plan, out: Path, devices: Devices, overwrite: bool) -> Surrogate:
    """Say what the training will cost, and train."""
    foreseen = forecast(plan)
    seconds = plan.budget_s or foreseen.flow_s / devices.count + foreseen.network_s
    if first():
        print_message(plan.scene.explain(plan.samples))
        print_message(
            f"This training: about {foreseen.green_applications:,.0f} convolutions (G) and "
            f"{duration(seconds)} ({duration(foreseen.flow_s)} of flows on one device, "
            f"{duration(foreseen.network_s)} of network) on {devices.count} device"
            f"{'' if devices.count == 1 else 's'}; {plan.held_out} held-out flows, about "
            f"{duration(foreseen.held_out_s / devices.count)}, and compilation (minutes for a new "
            "kind of scene) come on top."
        )
    notes = {"foreseen_g": foreseen.green_applications, "foreseen_s": seconds}
    return train_plan(plan, out, first(), devices, overwrite=overwrite, notes=notes)


def _parser() -> Parser:
    parser = Parser(__doc__)
    add = parser.add_argument
    add("--method", required=True, help=f"{', '.join(METHODS)} (explained below)")
    add("--scene", help="TOML file (unbounded, Re 1 to 40, fidelity standard)")
    add("--samples", type=int, help=f"training samples, from 4 ({SAMPLES_HELP})")
    help = "surrogate of fewer --samples (same scene, seed): add those where its bounds are largest"
    add("--infill-from", metavar="DIR", help=help)
    add("--held-out", type=int, help=f"unseen bodies that give the errors ({HELD_OUT_HELP})")
    add("--preset", default="quick", choices=list(PRESETS), help="samples and iterations (quick)")
    add(
        "--budget-seconds",
        type=float,
        help="train for this time instead, from 1 s; compilation and held-out flows come on top",
    )
    add("--width", type=int, help="width of both hidden layers of the network (20; with lift 32)")
    add("--published", action="store_true", help="the method as published, not at its best")
    add("--seed", type=int, default=0, help="seed of samples and weights, from 0 (0)")
    add("--out", required=True, help="folder of the surrogate")
    add("--overwrite", action="store_true", help="replace a surrogate that is there")
    add_distributed_arguments(parser)
    return parser
