"""Whether the bounds that shipped surrogates state for their errors hold for bodies drawn anew.

And for one kind of bodies whose lift and moment are zero by symmetry.
"""

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


def round_in_the_plane(run: Run, low: float, high: float) -> Row:
    """Return how many Cl and Cm, all zero, of spheroids about their width axis are in their bounds.

    Seen from the side such a body is a circle, so that it is the same at every incidence.

    Args:
      run: How the study is run.
      low: Least Re.
      high: Greatest Re.
    """
    net, count = load("pretrained:particle"), run.pick(8, 400)
    rng = np.random.default_rng(SEED)
    width, turn = rng.uniform(1, 2, count), rng.uniform(0, 90, count)
    reynolds = np.exp(rng.uniform(np.log(low), np.log(high), count))
    bodies = np.column_stack([width**-0.5, width, np.zeros(count), turn])
    loads, bounds = np.asarray(net.loads(bodies, reynolds)), net.error_bounds(bodies, reynolds)
    errors = np.abs(loads[:, 1:]) / loads[:, :1]
    row: Row = {"bodies": count}
    for k, name in enumerate(("cl", "cm")):
        row[f"{name}_mean"] = errors[:, k].mean()
        row[f"{name}_covered"] = np.mean(errors[:, k] <= bounds[:, k + 1])
    return row


def text(result: Result) -> str:
    """Return a sentence on how many of all errors lie within their bounds."""
    rows = result["rows"]
    count = sum(row["bodies"] for row in rows)
    covered = sum(row["bodies"] * row["covered"] for row in rows)
    return (
        f"{covered / count:.1%} of the {count} errors in the first table lie within their bounds, "
        "which are made for 95 %."
    )


COLUMNS = columns(
    "surrogate {surrogate} | load {load} | bodies {bodies} | error over Cd: mean {mean:.3%}"
    " | 95 % below {p95:.3%} | largest {max:.3%} | within the bound {covered:.1%}"
    " | median bound {bound:.3%} | median of bound over error {ratio:.1f}"
    " | mean error of the quarter with the smallest bounds {sure:.3%}"
    " | with the largest {unsure:.3%}"
)
ROUND = columns(
    "Re {low:g} to {high:g} | bodies {bodies} | mean error of Cl over Cd {cl_mean:.3%}"
    " | within its bound {cl_covered:.1%} | of Cm {cm_mean:.3%} | within its bound {cm_covered:.1%}"
)
RANGES = [{"low": 0.1, "high": 1.0}, {"low": 1.0, "high": 30.0}, {"low": 30.0, "high": 100.0}]
TABLES = [
    Table(cases(surrogate=NAMES), measure, COLUMNS),
    Table(RANGES, round_in_the_plane, ROUND, key="round"),
]
STUDIES = {"confidence": Study(TABLES, text)}
