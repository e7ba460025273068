"""Every method and the rivals a user would pick, on the same bodies: error against work.

    python scripts/measure_training.py --preset quick --out out/quick
    python scripts/measure_training.py --preset full --out out/full --json

Kriging needs scikit-learn: pip install -e '.[bench]'.
"""

import dataclasses
import itertools
import json
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from common import Parser, emit, markdown, progress_bar, run
from train_surrogate import train_all

from surrogate.errors import InvalidInput
from surrogate.files import whole_file
from surrogate.store import Surrogate
from surrogate.training.loop import Bench
from surrogate.training.physics import Samples, require_converged, solve_labels

MARKS = (0.03, 0.01, 0.003)


@dataclasses.dataclass(frozen=True)
class Row:
    """Held-out drag errors of one method; ``reached`` maps an error to the work it took."""

    method: str
    error_mean: float
    error_p95: float
    error_max: float
    green_applications: int
    seconds: float | None
    reached: dict[str, int | None]


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Train what is not trained yet, fit the rivals, tabulate."""
    arguments = _parser().parse_args(argv)
    out = Path(arguments.out)
    fitters = {"polynomial": _polynomial, "kriging": _kriging()}
    surrogates, bench = train_all(arguments.preset, arguments.seed, out)
    with progress_bar("rivals and gradients") as progress:
        rows = [_network_row(name, s, bench) for name, s in surrogates.items()]
        progress(0.5, "solving the samples for the rivals")
        labels = require_converged(solve_labels(bench.physics.domain, bench.physics.samples))
        work = int(np.sum(labels.products))
        drags = -2 * np.asarray(labels.amplitude[:, 0])
        rows += [_rival_row(name, fit, bench, drags, work) for name, fit in fitters.items()]
        progress(1.0)
    result = {"rows": [dataclasses.asdict(row) for row in rows], "held_out": len(_truth(bench))}
    with whole_file(out / "training.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, _text(rows))


def _truth(bench: Bench) -> np.ndarray:
    return -2 * np.asarray(bench.labels.amplitude[:, 0])


def _network_row(name: str, surrogate: Surrogate, bench: Bench) -> Row:
    held_out = bench.held_out
    predicted = np.asarray(jax.vmap(surrogate.network.drag)(*held_out))
    history = surrogate.record["history"]
    reached = {
        f"{mark:g}": next((int(g) for _, _, g, mean, _ in history if mean <= mark), None)
        for mark in MARKS
    }
    work, seconds = surrogate.record["green_applications"], surrogate.record["train_s"]
    return _row(name, predicted, bench, work, seconds + surrogate.record["setup_s"], reached)


def _rival_row(name: str, fit: Callable, bench: Bench, drags: np.ndarray, work: int) -> Row:
    """Fit log Cd on all solved samples; what a fraction of them reaches, a fraction of the work."""
    inputs = _inputs(bench, bench.physics.samples)
    target, unseen = np.log(drags), _inputs(bench, bench.held_out)
    reached: dict[str, int | None] = {f"{mark:g}": None for mark in MARKS}
    for share in (0.125, 0.25, 0.5, 1.0):
        count = round(share * len(drags))
        predicted = np.exp(fit(inputs[:count], target[:count])(unseen))
        mean = np.mean(np.abs(predicted / _truth(bench) - 1))
        for mark in MARKS:
            if mean <= mark and reached[f"{mark:g}"] is None:
                reached[f"{mark:g}"] = round(share * work)
    return _row(name, predicted, bench, work, None, reached)


def _row(name, predicted, bench: Bench, work, seconds, reached) -> Row:
    errors = np.abs(predicted / _truth(bench) - 1)
    return Row(
        name,
        float(errors.mean()),
        float(np.percentile(errors, 95)),
        float(errors.max()),
        int(work),
        seconds,
        reached,
    )


def _inputs(bench: Bench, samples: Samples) -> np.ndarray:
    """Shape parameters and log Re, scaled to [-1, 1] as the network's are."""
    raw = np.column_stack([samples.parameters, np.log(samples.reynolds)])
    low, high = np.asarray(bench.network.low), np.asarray(bench.network.high)
    return 2 * (raw - low) / (high - low) - 1


def _polynomial(x: np.ndarray, y: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Least squares on all monomials of degree 4, or of what the samples can carry."""
    degree = next(d for d in (4, 3, 2, 1) if len(_powers(x.shape[1], d)) <= 0.7 * len(x))
    powers = _powers(x.shape[1], degree)
    weights = np.linalg.lstsq(_monomials(x, powers), y, rcond=None)[0]
    return lambda z: _monomials(z, powers) @ weights


def _powers(variables: int, degree: int) -> np.ndarray:
    every = itertools.product(range(degree + 1), repeat=variables)
    return np.array([p for p in every if sum(p) <= degree])


def _monomials(x: np.ndarray, powers: np.ndarray) -> np.ndarray:
    return np.prod(x[:, None, :] ** powers[None], axis=2)


def _kriging() -> Callable:
    """Gaussian process with one length scale per input, fitted by maximum likelihood."""
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    except ImportError:
        raise InvalidInput("kriging needs scikit-learn: pip install -e '.[bench]'") from None

    def fit(x, y):
        kernel = ConstantKernel(1.0, (1e-3, 1e4)) * RBF(np.full(x.shape[1], 2.0), (0.05, 50))
        process = GaussianProcessRegressor(
            kernel + WhiteKernel(1e-6, (1e-12, 1e-2)), normalize_y=True, n_restarts_optimizer=2
        )
        process.random_state = 0
        with warnings.catch_warnings():  # a length scale at its bound, an early end of the search
            warnings.simplefilter("ignore", ConvergenceWarning)
            return process.fit(x, y).predict

    return fit


def _text(rows: list[Row]) -> str:
    """A Markdown table."""
    heads = ["method", "mean", "95 %", "max", "applications of G", "time"]
    heads += [f"G to {100 * mark:g} %" for mark in MARKS]
    lines = []
    for row in rows:
        errors = (row.error_mean, row.error_p95, row.error_max)
        cells = [row.method, *(f"{100 * e:.2f} %" for e in errors), f"{row.green_applications}"]
        cells.append("" if row.seconds is None else f"{row.seconds:.0f} s")
        cells += ["-" if g is None else str(g) for g in row.reached.values()]
        lines.append(cells)
    return markdown(heads, lines)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--preset", default="quick", choices=["quick", "full"])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", required=True, help="folder of the surrogates and training.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
