"""Harmonics of the traction on bodies with high modes: errors of the loads by their number."""

from unittest import mock

import numpy as np
from study import Row, Run, Study, Table, columns

from surrogate import Flow, Scene, Shape, contour_shape, family_shape
from surrogate.arrays import AnyArray
from surrogate.scene import fidelity

REYNOLDS = 30.0
MORE = {"none": -fidelity.MOST_HARMONICS, "chosen": fidelity.MORE_HARMONICS, "four": 4}
EXACT = 10  # more harmonics than the highest mode, whose loads are taken as exact
BODIES = {
    "beta5 0.1": {"aspect": 1.5, "beta5": 0.1},
    "beta6 0.1": {"aspect": 1.5, "beta6": 0.1},
    "beta7 0.1": {"aspect": 1.5, "beta7": 0.1},
    "beta8 0.1": {"aspect": 1.5, "beta8": 0.1},
    "beta10 0.05": {"aspect": 1.5, "beta10": 0.05},
    "beta12 0.06": {"aspect": 2.0, "beta12": 0.06},
    "gamma5 0.25": {"aspect": 2.0, "gamma5": 0.25},
    "gamma6 0.25": {"aspect": 2.0, "gamma6": 0.25},
    "12 waves of 0.1": None,
}


def measure(run: Run, body: str) -> Row:
    """Return a body's highest mode, and the largest error of its loads by every number.

    Args:
      run: How the study is run.
      body: One of ``BODIES``.
    """
    shape = waves(12, 0.1) if BODIES[body] is None else family_shape(BODIES[body])
    exact = _loads(run, shape, EXACT)
    errors = {name: _loads(run, shape, more) - exact for name, more in MORE.items()}
    largest = {name: np.abs(error).max() / exact[0] for name, error in errors.items()}
    return {"mode": shape.highest_mode, **largest}


def waves(count: int, size: float) -> Shape:
    """Return a circle with this number of waves of this size over its radius."""
    angle = 2 * np.pi * np.arange(400) / 400
    radius = 1 + size * np.cos(count * angle)
    return contour_shape(np.column_stack([-radius * np.cos(angle), radius * np.sin(angle)]))


def _loads(run: Run, shape: Shape, more: int) -> AnyArray:
    """Cd, Cl and Cm with this many more harmonics than the body's highest mode."""
    with mock.patch.object(fidelity, "MORE_HARMONICS", more):
        flow = Flow(Scene(fidelity=run.fidelity("standard")))
        found = flow.solve(shape, REYNOLDS, allow_unsteady=True, estimate=False)
    return found.loads


COLUMNS = columns(
    "body {body} | highest mode k {mode} | error by the usual harmonics {none:.2%} | "
    "by at least k + 2, chosen {chosen:.2%} | k + 4 {four:.2%}"
)
STUDIES = {"harmonics": Study([Table([{"body": body} for body in BODIES], measure, COLUMNS)])}
