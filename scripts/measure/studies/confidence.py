"""Whether the bounds that shipped surrogates state for their errors hold for bodies drawn anew."""

import dataclasses
import functools

import jax
import numpy as np
from study import TINY, Result, Row, Run, Study, Table, cases, columns

from surrogate import Flow, Scene, load
from surrogate.model.outputs import LOAD_NAMES, SYMBOLS
from surrogate.scene.samples import Samples, held_out_samples
from surrogate.training.history import load_errors

SEED = 101  # no training and no scale of bounds used it
METHODS = ("dp", "sip", "hig", "supervised")
NAMES = tuple(f"pretrained:{name}" for name in (*METHODS, "space", "lift", "particle"))
COUNTS = {2: 192, 3: 96}  # bodies, by the scene's dimension
QUARTERS = (0.25, 0.75)  # of the bodies, ordered by their bounds


def measure(run: Run, surrogate: str) -> list[Row]:
    """Return a row for every load: its errors, and how many of them lie within their bounds.

    The rows also compare the errors of the bodies with the smallest and with the largest bounds.
    """
    net = load(surrogate)
    scene = dataclasses.replace(net.scene, fidelity=run.pick(TINY, net.scene.fidelity))
    samples, loads = _drawn(scene, run.pick(4, COUNTS[scene.dimension]))
    errors, bounds = load_errors(net.network, samples, loads), net.error_bounds(*samples)
    rows = []
    for name, error, bound in zip(LOAD_NAMES, np.asarray(errors).T, bounds.T, strict=False):
        few, many = np.quantile(bound, QUARTERS)
        row = {"load": SYMBOLS[name], "bodies": len(error), "covered": np.mean(error <= bound)}
        row |= {"mean": error.mean(), "p95": np.quantile(error, 0.95), "max": error.max()}
        row |= {"bound": np.median(bound), "ratio": np.median(bound / error)}
        row |= {"sure": error[bound <= few].mean(), "unsure": error[bound >= many].mean()}
        rows.append(row)
    return rows


@functools.lru_cache(maxsize=1)
def _drawn(scene: Scene, count: int) -> tuple[Samples, np.ndarray]:
    """Bodies drawn anew, but for those whose flow was not found, and their loads."""
    samples = held_out_samples(scene, SEED, count)
    flows = Flow(scene).solve_all(*samples, allow_unsteady=True, partial=True)
    found = np.flatnonzero(flows.converged)
    return jax.tree.map(lambda leaf: leaf[found], (samples, flows.loads))


def text(result: Result) -> str:
    """Return a sentence on how many of all errors lie within their bounds."""
    rows = result["rows"]
    count = sum(row["bodies"] for row in rows)
    covered = sum(row["bodies"] * row["covered"] for row in rows)
    return (
        f"{covered / count:.1%} of these {count} errors lie within their bounds, which are made "
        "for 95 %."
    )


COLUMNS = columns(
    "surrogate {surrogate} | load {load} | bodies {bodies} | error over Cd: mean {mean:.3%}"
    " | 95 % below {p95:.3%} | largest {max:.3%} | within the bound {covered:.1%}"
    " | median bound {bound:.3%} | median of bound over error {ratio:.1f}"
    " | mean error of the quarter with the smallest bounds {sure:.3%}"
    " | with the largest {unsure:.3%}"
)
STUDIES = {"confidence": Study([Table(cases(surrogate=NAMES), measure, COLUMNS)], text)}
