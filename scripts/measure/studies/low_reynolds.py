"""Cd of the cylinder towards Re = 0: unbounded beside Kaplun's expansion, and between walls."""

import math
from unittest import mock

import numpy as np
from study import Row, Run, Study, Table, cases, columns

from surrogate import Flow, Scene, family_shape
from surrogate.flow.grid import domain_2d

NUMBERS = (0.001, 0.003, 0.01, 0.03, 0.1)
HEIGHTS = (3.0, 8.0)  # of tunnels in D
CYLINDER = {"aspect": 1.0}


def unbounded(run: Run, reynolds: float) -> Row:
    """Return Cd, its bound, and what it is above Kaplun's; also with the far field of higher Re.

    Args:
      run: How the study is run.
      reynolds: U D / nu.
    """
    scene, body = Scene(fidelity=run.fidelity("standard")), family_shape(CYLINDER)
    found, exact = Flow(scene).solve(body, reynolds, estimate=not run.tiny), kaplun(reynolds)
    with mock.patch.object(domain_2d, "FAR_REYNOLDS", 0.0):
        near = Flow(scene).solve(body, reynolds, estimate=False).drag
    size = max(lattice.shape[0] * lattice.step[0] for lattice in found.domain.far)
    row = {"cd": found.drag, "bound": found.estimated_error, "size": size}
    return row | {"error": found.drag / exact - 1, "near": near / exact - 1}


def between_walls(run: Run, height: float, reynolds: float) -> Row:
    """Return Cd Re in a tunnel, which does not depend on Re in Stokes flow, and Cd's bound.

    Args:
      run: How the study is run.
      height: Of the tunnel in D.
      reynolds: U D / nu.
    """
    flow = Flow(Scene(f"tunnel:{height:g}", fidelity=run.fidelity("standard")))
    found = flow.solve(family_shape(CYLINDER), reynolds, estimate=not run.tiny)
    return {"scaled": reynolds * found.drag, "bound": found.estimated_error}


def kaplun(reynolds: float) -> float:
    """Return Cd of the cylinder by matched expansions to third order (Kaplun 1957)."""
    inverse = 1 / (0.5 - np.euler_gamma - math.log(reynolds / 8))
    return 8 * math.pi / reynolds * (inverse - 0.87 * inverse**3)


COLUMNS = columns(
    "Re {reynolds:g} | Cd {cd:.5g} | its bound {bound:.2%} | far field to, D {size:,.0f} | "
    "over Kaplun's {error:+.3%} | with the far field to 384 D {near:+.3%}"
)
WALLS = columns(
    "tunnel {height:g} | Re {reynolds:g} | Cd Re {scaled:.3f} | bound of Cd {bound:.2%}"
)
STUDIES = {
    "low_reynolds": Study(
        [
            Table(cases(reynolds=NUMBERS), unbounded, COLUMNS),
            Table(cases(height=HEIGHTS, reynolds=NUMBERS), between_walls, WALLS, "walls"),
        ]
    )
}
