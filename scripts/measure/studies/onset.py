"""Critical Re at which the steady wake of a body of revolution loses its symmetry.

There a disturbance of azimuthal wave number one neither grows nor decays.
"""

import contextlib
import math
from collections.abc import Callable, Mapping
from typing import Any

from elements import AXISYMMETRIC, at_rest, ngsolve, solve_by_continuation
from meshes import Elements
from scipy.optimize import root_scalar
from study import Row, Run, Study, Table, columns
from tools import name_of

from surrogate import NotConverged, family_shape
from surrogate.scene.limits import onset_of

BODIES = (
    {"aspect": 0.6, "beta3": 0.12},
    *({"aspect": aspect} for aspect in (0.4, 0.5, 0.6, 0.7, 0.85, 1.0)),
    {"aspect": 0.7, "beta2": 0.2},
    {"aspect": 0.7, "beta2": -0.2},
)
MESH = Elements(order=3, box=40.0, wall=0.06, near=0.2, wake=0.6)
COARSE = Elements(order=2, box=10.0, wall=0.2, near=0.5)
SHIFT = 0.05  # of eigenvalues, U / D: the mode that begins to grow is the nearest to it
START = 1.3, 1.2  # Re over the rule's onset; there the mode stands out from those that decay
CLOSE = 3e-3  # of Re, over the rule's onset
SECANTS, INVERSES = 8, 300  # at most
TOLERANCE = 1e-6  # of an eigenvalue, U / D


def measure(run: Run, body: str, parameters: Mapping[str, float]) -> Row:
    """Return the critical Re of a body, or None where the search fails."""
    shape, onset = family_shape(parameters, dimension=3), None
    guesses = (share * onset_of(shape) for share in START)
    with contextlib.suppress(NotConverged):
        growth = growth_of(parameters, run.pick(COARSE, MESH))
        onset = critical(growth, *guesses, CLOSE * onset_of(shape))
    return {"slenderness": shape.extent[0] / max(shape.extent[1:]), "onset": onset}


def critical(
    growth: Callable[[float], float], first: float, second: float, tolerance: float
) -> float:
    """Return the argument at which a growth rate is zero, by the secant method.

    Args:
      growth: rate as a function of Re or of 1 / Re.
      first: a guess of the argument.
      second: another guess.
      tolerance: of the argument, absolute.

    Raises:
      NotConverged: It is not found.
    """
    found = root_scalar(growth, x0=first, x1=second, xtol=tolerance, maxiter=SECANTS)
    if not found.converged:
        raise NotConverged(f"onset: not found near Re {found.root:.3g}")
    return found.root


def growth_of(body: Mapping[str, float], elements: Elements) -> Callable[[float], float]:
    """Return a function of Re, the growth rate (U / D) of the leading disturbance.

    The disturbance has the azimuthal wave number one.

    Raises:
      Unavailable: NGSolve is not installed.
    """
    ng = ngsolve()
    flow = at_rest(ng, AXISYMMETRIC, body, elements)

    def growth(reynolds: float) -> float:
        solve_by_continuation(ng, flow, reynolds, AXISYMMETRIC)
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
    divergence = p * (r * ng.div(v) + v[1] - z) + q * (r * ng.div(u) + u[1] - w)
    mass = r * (u * v + w * z)
    shifted, weighing = ng.BilinearForm(space), ng.BilinearForm(space)
    shifted += (viscous / reynolds + inertia - divergence + SHIFT * mass) * ng.dx(bonus_intorder=2)
    weighing += mass * ng.dx
    return space, shifted.Assemble().mat, weighing.Assemble().mat


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


def with_rule(rows: list[Row]) -> list[Row]:
    """Return the rows with the onset by the flow solver's rule and its error."""
    found = []
    for row in rows:
        pairs = (part.split() for part in row["body"].split(", "))
        body = {name: float(value) for name, value in pairs}
        rule = onset_of(family_shape(body, dimension=3))
        error = rule / row["onset"] - 1 if row.get("onset") else None
        found.append(row | {"rule": rule, "error": error})
    return found


COLUMNS = columns(
    "body {body} | length over width {slenderness:.2f} | critical Re {onset:.1f}"
    " | rule {rule:.1f} | error {error:+.1%}"
)
CASES = [{"body": name_of(body), "parameters": body} for body in BODIES]
STUDIES = {"onset": Study([Table(CASES, measure, lambda rows: COLUMNS(with_rule(rows)))])}
