"""Up to which Re wakes keep their axis: the flows in space that are refused beyond it.

python scripts/measure/onset.py

The steady flow past a body of revolution loses its symmetry where a disturbance of one wave round
the axis neither grows nor decays. Needs NGSolve: pip install -e '.[bench]'.
"""

import math
import sys
from collections.abc import Callable, Mapping
from typing import Any

from axisymmetric import AZIMUTH, at_rest
from elements import Elements, climb
from study import Result, Study, ngsolve, run_study, table_of_rows

from surrogate import InvalidInput, NotConverged, family_shape
from surrogate.scene.limits import onset_of_shedding

BODIES = (
    {"aspect": 0.4},
    {"aspect": 0.5},
    {"aspect": 0.6},
    {"aspect": 0.7},
    {"aspect": 0.85},
    {"aspect": 1.0},
    {"aspect": 0.7, "beta2": 0.2},
    {"aspect": 0.7, "beta2": -0.2},
    {"aspect": 0.6, "beta3": 0.12},
)
MESH = Elements(order=3, box=40.0, wall=0.06, near=0.2, wake=0.6)
COARSE = Elements(order=2, box=10.0, wall=0.2, near=0.5)
SHIFT = 0.05  # of eigenvalues, D / U: the mode that is about to grow is the nearest to it
BEYOND = 1.3, 1.2  # of the limit, where to begin: there the mode stands out from decaying ones
CLOSE = 3e-3  # relative, of Re
SECANTS, INVERSES = 8, 300  # at most
TOLERANCE = 1e-6  # of an eigenvalue, D / U
HEADS = "body | length over width | the wake loses its axis at Re | refused beyond"
FORMS = "{body} | {slenderness:.2f} | {onset:.1f} | {limit:.1f}"


def measure(tiny: bool, progress: Callable) -> Result:
    """Bodies of revolution that are no longer than wide, and what limits say of them."""
    rows, missing = [], ""
    for k, body in enumerate(BODIES[-1:] if tiny else BODIES):
        name = ", ".join(f"{key} {value:g}" for key, value in body.items())
        progress(k / len(BODIES), name)
        extent = family_shape(body, dimension=3).extent
        limit, onset = float(onset_of_shedding(extent)), None
        try:
            growth = growth_of(body, COARSE if tiny else MESH)
            onset = critical(growth, limit)
        except (InvalidInput, NotConverged) as reason:
            missing = str(reason)
        row = {"body": name, "slenderness": extent[0] / max(extent[1:]), "limit": limit}
        rows.append(row | {"onset": onset})
    return {"rows": rows, "missing": missing}


def critical(growth: Callable[[float], float], start: float) -> float:
    """Re at which nothing grows nor decays, by secants."""
    last, re = (share * start for share in BEYOND)
    before = growth(last)
    for _ in range(SECANTS):
        rate = growth(re)
        after = re - rate * (re - last) / (rate - before)
        last, before, re = re, rate, after
        if abs(re / last - 1) < CLOSE:
            return re
    raise NotConverged(f"onset: not found near Re {re:.3g}")


def growth_of(body: Mapping[str, float], elements: Elements) -> Callable[[float], float]:
    """Of Re the rate, U / D, at which a disturbance of one wave round the axis grows.

    Raises:
      InvalidInput: NGSolve is not installed.
    """
    ng = ngsolve()
    flow = at_rest(ng, body, elements)

    def growth(reynolds: float) -> float:
        climb(ng, flow, reynolds, AZIMUTH)
        return _rate(ng, *_disturbed(ng, flow.components[0], reynolds, elements.order))

    return growth


def _disturbed(ng: Any, stream: Any, reynolds: float, order: int) -> tuple[Any, Any, Any]:
    """The space of disturbances (u_x, u_r, i w) exp(i phi) with pressure, A + SHIFT M, and M.

    Of M du/dt = -A u, linear in the disturbance of a flow without swirl.
    """
    mesh, r, gradient = stream.space.mesh, ng.y, ng.Grad(stream)
    walls, axis = "body|stream", "axis|body|stream"
    meridian = ng.VectorH1(mesh, order=order, dirichletx=axis, dirichlety=walls)
    azimuth = ng.H1(mesh, order=order, dirichlet=walls)
    space = meridian * azimuth * ng.H1(mesh, order=order - 1, dirichlet="axis")
    (u, w, p), (v, z, q) = space.TnT()
    viscous = r * (ng.InnerProduct(ng.Grad(u), ng.Grad(v)) + ng.Grad(w) * ng.Grad(z))
    viscous += (u[0] * v[0] + 2 * (u[1] - w) * (v[1] - z)) / r
    inertia = r * ((ng.Grad(u) * stream + gradient * u) * v + (stream * ng.Grad(w)) * z)
    inertia += stream[1] * w * z
    spread = p * (r * ng.div(v) + v[1] - z) + q * (r * ng.div(u) + u[1] - w)
    mass = r * (u * v + w * z)
    moving, weighing = ng.BilinearForm(space), ng.BilinearForm(space)
    moving += (viscous / reynolds + inertia - spread + SHIFT * mass) * ng.dx(bonus_intorder=2)
    weighing += mass * ng.dx
    return space, moving.Assemble().mat, weighing.Assemble().mat


def _rate(ng: Any, space: Any, shifted: Any, mass: Any) -> float:
    """The eigenvalue nearest to the shift, by inverse iteration."""
    inverse = shifted.Inverse(space.FreeDofs())
    state, heavy = shifted.CreateColVector(), shifted.CreateColVector()
    state.SetRandom(1)
    last = math.inf
    for _ in range(INVERSES):
        heavy.data = mass * state
        solved = (inverse * heavy).Evaluate()
        rate = SHIFT - ng.InnerProduct(heavy, state) / ng.InnerProduct(heavy, solved)
        if abs(rate - last) < TOLERANCE:
            return rate
        last = rate
        state.data = 1 / math.sqrt(ng.InnerProduct(solved, mass * solved)) * solved
    raise NotConverged("onset: no eigenvalue was found")


STUDY = Study("onset", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
