"""Every method and the rivals a user would pick, on the same bodies: error against work and time.

    python scripts/measure_training.py --preset quick --out out/quick
    python scripts/measure_training.py --preset full --seeds 3 --out out/full --json

Kriging needs scikit-learn: pip install -e '.[bench]'.
"""

import dataclasses
import functools
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from common import Parser, emit, markdown, progress_bar, run
from rivals import kriging, polynomial
from train_surrogate import train_all, train_with_bar
from training_plot import plot_training

from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import check_folder, whole_file
from surrogate.flow.flow import family_drag_and_shape_gradient
from surrogate.model.network import DragNetwork
from surrogate.training.loop import Bench
from surrogate.training.physics import Samples, require_converged, solve_labels
from surrogate.training.presets import preset
from surrogate.training.methods.sip import scale_invariant_physics
from surrogate.training.methods.supervised import supervised

MARKS = (0.03, 0.01, 0.003)
GRADIENTS = 64  # held-out bodies whose shape gradients are compared
VARIANTS = {  # the method as published, and regressions that a user might try
    "sip, as published": functools.partial(scale_invariant_physics, slopes=0.0),
    "supervised, traction only": functools.partial(supervised, goal=0.0),
    "supervised, drag only": functools.partial(supervised, modes=0.0, goal=1.0),
    "supervised, with slopes": functools.partial(supervised, slopes=1.0),
}
Reached = dict[str, float | None]


@dataclasses.dataclass(frozen=True)
class Row:
    """Held-out errors of one method and seed; ``reached`` maps a drag error to its price."""

    method: str
    seed: int
    error_mean: float
    error_p95: float
    error_max: float
    traction: float | None
    gradient: float | None
    green_applications: int
    seconds: float | None
    reached: Reached
    reached_s: Reached
    history: list[list[float]]


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Train what is not trained yet, fit the rivals, tabulate, plot."""
    arguments = _parser().parse_args(argv)
    if not 1 <= arguments.seeds <= 20:
        raise InvalidInput(f"--seeds {arguments.seeds}: from 1 to 20")
    unseen = preset("dp", arguments.preset, arguments.seed).held_out
    gradients = min(GRADIENTS, unseen) if arguments.gradients is None else arguments.gradients
    if not 1 <= gradients <= unseen:
        raise InvalidInput(f"--gradients {gradients}: from 1 to {unseen}")
    out = Path(arguments.out)
    check_folder(out)
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    folders = [out if seed == arguments.seed else out / f"seed{seed}" for seed in seeds]
    asked = [[arguments.preset, seed, gradients] for seed in seeds]
    kept = [_kept_rows(folder, question) for folder, question in zip(folders, asked, strict=True)]
    fitters = {"polynomial": polynomial} | ({} if all(kept) else {"kriging": kriging()})
    rows: list[Row] = []
    for folder, question, known in zip(folders, asked, kept, strict=True):
        rows += known or _measured_rows(folder, question, fitters)
    plot = plot_training([dataclasses.asdict(row) for row in rows], out / "training.png")
    result = {"rows": [dataclasses.asdict(row) for row in rows], "plot": str(plot)}
    with whole_file(out / "training.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, f"{_text(rows)}\n\n-> {plot}")


def _kept_rows(folder: Path, asked: list) -> list[Row]:
    """The rows that an earlier run left in a seed's folder; none where it left none."""
    kept = folder / "rows.json"
    if not kept.is_file():
        return []
    try:
        record = json.loads(kept.read_text())
        found, rows = record["asked"], [Row(**row) for row in record["rows"]]
    except (OSError, ValueError, KeyError, TypeError):
        raise InvalidInput(f"{kept}: is damaged or of another program; remove it") from None
    if found != asked:
        raise InvalidInput(f"{kept}: is of another preset or seed; choose another --out")
    return rows


def _measured_rows(folder: Path, asked: list, fitters) -> list[Row]:
    """The rows of preset, seed and number of gradients, measured and kept."""
    name, seed, gradients = asked
    rows = _seed_rows(name, seed, folder, fitters, gradients)
    record = {"asked": asked, "rows": [dataclasses.asdict(row) for row in rows]}
    with whole_file(folder / "rows.json") as part:
        part.write_text(json.dumps(record) + "\n")
    return rows


def _seed_rows(name: str, seed: int, folder: Path, fitters, gradients: int) -> list[Row]:
    """The four methods, their variants, and the rivals."""
    surrogates, bench = train_all(name, seed, folder)
    slopes = _gradients(bench, gradients)
    rows = [
        _row(method, seed, bench, slopes, s.network, s.record["history"], s.record["setup_s"])
        for method, s in surrogates.items()
    ]
    for method, make in VARIANTS.items():
        plan = preset(method.split(",")[0], name, seed)
        trained = train_with_bar(plan, bench, method=make(), title=method)
        history = [list(point[:5]) for point in trained.history]
        rows.append(_row(method, seed, bench, slopes, trained.network, history, bench.setup_s))
    with progress_bar("rivals") as progress:
        labels = require_converged(solve_labels(bench.physics.domain, bench.physics.samples))
        progress(0.9, f"{len(labels.products)} samples solved")
        rows += [
            _rival_row(rival, seed, fit, bench, labels, slopes) for rival, fit in fitters.items()
        ]
    return rows


def _truth(bench: Bench) -> np.ndarray:
    return -2 * np.asarray(bench.labels.amplitude[:, 0])


def _gradients(bench: Bench, count: int) -> np.ndarray:
    """Shape gradients of the first held-out bodies by the flow's adjoint, those that converged."""
    domain, held_out = bench.physics.domain, bench.held_out
    slopes = []
    with progress_bar("adjoint gradients") as progress:
        for k in range(count):
            body, reynolds = held_out.parameters[k], held_out.reynolds[k]
            _, slope, info = family_drag_and_shape_gradient(domain, body, reynolds)
            slopes.append(np.where(info.converged, slope, np.nan))
            progress((k + 1) / count)
    return np.array(slopes)


def _row(method, seed, bench: Bench, slopes, network: DragNetwork, history, setup_s) -> Row:
    """Errors: drag relative; traction in the rms of the held-out modes' spread; gradient relative.

    The gradient's is the median over bodies, in the norm of the parameters' ranges.
    """
    held_out = bench.held_out
    predicted = np.asarray(jax.vmap(network)(*held_out))
    labels = np.asarray(bench.labels.amplitude)
    scale = np.asarray(jax.vmap(network.scale)(held_out.reynolds))
    miss = (predicted - labels) / scale
    few = jax.tree.map(lambda leaf: leaf[: len(slopes)], held_out)
    learned = np.asarray(jax.vmap(jax.grad(network.drag))(*few))

    def price(mark: float, column: int) -> float | None:
        return next((point[column] for point in history if point[3] <= mark), None)

    _, seconds, work, *_ = history[-1]
    errors = np.abs(-2 * predicted[:, 0] / _truth(bench) - 1)
    return Row(
        method,
        seed,
        *_summary(errors),
        traction=float(np.sqrt(np.mean(miss**2))),
        gradient=_gradient_error(learned, slopes, bench),
        green_applications=int(work),
        seconds=seconds + setup_s,
        reached={f"{mark:g}": price(mark, 2) for mark in MARKS},
        reached_s={
            f"{mark:g}": None if (s := price(mark, 1)) is None else s + setup_s for mark in MARKS
        },
        history=history,
    )


def _gradient_error(learned: np.ndarray, slopes: np.ndarray, bench: Bench) -> float:
    widths = np.asarray(bench.network.high - bench.network.low)[:-1]
    good = np.all(np.isfinite(slopes), axis=1)
    if not good.any():
        raise NotConverged("no adjoint gradient of an unseen body converged")
    wrong, right = (g[good] * widths for g in (learned - slopes, slopes))
    return float(np.median(np.linalg.norm(wrong, axis=1) / np.linalg.norm(right, axis=1)))


def _fitted_gradients(predict: Callable, unseen: np.ndarray, bench: Bench) -> np.ndarray:
    """dCd/d(parameters) of a fitted log Cd, by central differences over a thousandth of a range."""
    widths = np.asarray(bench.network.high - bench.network.low)[:-1]
    step = 2e-3 * np.eye(unseen.shape[1])[: len(widths)]
    ahead, behind = (
        np.stack([predict(unseen + way * side) for side in step], axis=1) for way in (1, -1)
    )
    return np.exp(predict(unseen))[:, None] * (ahead - behind) / (2e-3 * widths)


def _rival_row(method: str, seed: int, fit: Callable, bench: Bench, labels, slopes) -> Row:
    """Fit log Cd on all solved samples; what a fraction of them reaches, a fraction of the work."""
    inputs, unseen = _inputs(bench, bench.physics.samples), _inputs(bench, bench.held_out)
    target = np.log(-2 * np.asarray(labels.amplitude[:, 0]))
    work = int(np.sum(labels.products))
    history = []
    for share in (0.125, 0.25, 0.5, 1.0):
        count = round(share * len(target))
        predict = fit(inputs[:count], target[:count])
        predicted = np.exp(predict(unseen))
        errors = np.abs(predicted / _truth(bench) - 1)
        history.append([count, 0.0, round(share * work), float(errors.mean()), float(errors.max())])
    reached: Reached = {
        f"{mark:g}": next((point[2] for point in history if point[3] <= mark), None)
        for mark in MARKS
    }
    nothing: Reached = dict.fromkeys(reached)
    learned = _fitted_gradients(predict, unseen[: len(slopes)], bench)
    gradient = _gradient_error(learned, slopes, bench)
    summary = _summary(errors)
    return Row(method, seed, *summary, None, gradient, work, None, reached, nothing, history)


def _summary(errors: np.ndarray) -> tuple[float, float, float]:
    return float(errors.mean()), float(np.percentile(errors, 95)), float(errors.max())


def _inputs(bench: Bench, samples: Samples) -> np.ndarray:
    """Shape parameters and log Re, scaled to [-1, 1] as the network's are."""
    raw = np.column_stack([samples.parameters, jnp.log(samples.reynolds)])
    low, high = np.asarray(bench.network.low), np.asarray(bench.network.high)
    return 2 * (raw - low) / (high - low) - 1


def _text(rows: list[Row]) -> str:
    """A Markdown table: means over the seeds, with half the spread; times of the first seed."""
    heads = ["method", "drag: mean", "95 %", "max", "traction", "gradient", "G", "time"]
    heads += [f"G (time) to {100 * mark:g} %" for mark in MARKS]
    lines = []
    for method in dict.fromkeys(row.method for row in rows):
        mine = [row for row in rows if row.method == method]
        columns = ("error_mean", "error_p95", "error_max", "traction", "gradient")
        cells = [method, *(_percent([getattr(row, c) for row in mine]) for c in columns)]
        cells.append(f"{np.mean([row.green_applications for row in mine]):.0f}")
        cells.append("" if mine[0].seconds is None else f"{mine[0].seconds:.0f} s")
        for mark in MARKS:
            key = f"{mark:g}"
            work, seconds = ([getattr(r, c)[key] for r in mine] for c in ("reached", "reached_s"))
            if None in work:
                cells.append("-")
            else:
                time = "" if None in seconds else f" ({seconds[0]:.0f} s)"
                cells.append(f"{np.mean(work):.0f}{time}")
        lines.append(cells)
    return markdown(heads, lines)


def _percent(values: Sequence[float | None]) -> str:
    if None in values:
        return ""
    spread = f" ± {50 * np.ptp(values):.2f}" if len(values) > 1 else ""
    return f"{100 * np.mean(values):.2f}{spread} %"


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--preset", default="quick", choices=["quick", "full"])
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument("--seeds", type=int, default=1, help="how many seeds")
    parser.add_argument(
        "--gradients", type=int, help=f"bodies with adjoint gradients ({GRADIENTS})"
    )
    parser.add_argument("--out", required=True, help="folder of the surrogates and training.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
