"""Critical Re at which the steady flow past a 3-D body turned or flattened loses its stability.

There a disturbance of the flow, symmetric or antisymmetric about each mirror plane, neither grows
nor decays. An ellipsoid at 90 degrees is one at 0 degrees with its axes exchanged, so that a
quarter of space suffices; bodies at other incidences are solved in half of space. The mirror planes
are y = 0, "flank", and z = 0, "floor".
"""

import contextlib
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from elements import (
    FLATTENED,
    WALLS,
    at_rest,
    ngsolve,
    solve_by_continuation,
)
from elements import Geometry as Part
from meshes import Elements, half
from studies.onset import critical, with_rule
from studies.onset_2d import disturbances
from study import Row, Run, Study, Table, columns
from tools import name_of
from weak_forms import cartesian_form, green_3d

from surrogate import NotConverged, family_shape
from surrogate.scene.limits import onset_of

MESH = Elements(order=2, box=10.0, wall=0.1, near=0.25, wake=1.2, margin=0.3)
MESHES = {
    "tiny": Elements(order=2, box=6.0, wall=0.4, near=0.8, wake=2.0, margin=0.3),
    "usual": MESH,
    "finer": MESH._replace(wall=0.08, near=0.2, wake=1.0),
}
HALF_SPACE = Part(
    3,
    half,
    cartesian_form,
    green_3d,
    2.0,
    8 / math.pi,
    (("dirichlet", WALLS), ("dirichlety", f"flank|{WALLS}")),
    MESH,
)
NORMALS = {"flank": "y", "floor": "z"}  # of the mirror planes
ANTISYMMETRIC = {"flank": "y = 0", "floor": "z = 0", "none": "neither"}  # as tables name them
START = 1.04, 0.96  # 1 / Re times the rule's onset
CLOSE = 0.024  # of 1 / Re, times the rule's onset; secants lose an error of 3 % in one step
FLOW_TOLERANCE = 1e-4  # of the steady flow
SHIFT = 2.0  # U / D, of the filter that modes of a frequency near zero and near 1 pass alike
KRYLOV, RITZ = 80, 6  # vectors, and Ritz vectors that may be modes
RESIDUAL = 0.03  # of a Ritz vector that is one, relative
HIGHEST = 210.0  # Re at which the growth rate of bodies that are not searched is measured


class Mode(NamedTuple):
    """A disturbance exp(rate t) and the mirror plane about which it is antisymmetric."""

    rate: complex
    plane: str


class Disturbances:
    """The leading disturbances of the steady flow past a 3-D body, from Re to Re.

    Raises:
      Unavailable: NGSolve is not installed.
    """

    def __init__(self, body: Mapping[str, float], elements: Elements) -> None:
        self.ng = ngsolve()
        lying = aligned(body)
        self.part, self.planes = FLATTENED, ("flank", "floor")
        if lying.get("incidence"):
            self.part, self.planes = HALF_SPACE, ("flank",)
        self.flow = at_rest(self.ng, self.part, lying, elements)
        self.order, self.force, self.leading = elements.order, 0.0, Mode(0j, "")
        self.starts: dict[str, np.ndarray] = {}

    def growth(self, reynolds: float) -> float:
        """Return the growth rate, U / D, of the leading mode at this Re."""
        self.force = solve_by_continuation(
            self.ng, self.flow, reynolds, self.part, self.force, FLOW_TOLERANCE
        )
        odd = self.planes if len(self.planes) == 2 else (*self.planes, "none")
        found = [Mode(rate, plane) for plane in odd for rate in self._rates(reynolds, plane)]
        if not found:
            raise NotConverged(f"onset: no mode was found at Re {reynolds:g}")
        self.leading = max(found, key=lambda mode: mode.rate.real)
        return self.leading.rate.real

    def _rates(self, reynolds: float, odd: str) -> list[complex]:
        """Rates of modes antisymmetric about one plane and symmetric about the other, if any.

        With S = (A - SHIFT M)^-1 M, Arnoldi's method is applied to S (1 + 2 SHIFT S), two steps in
        time: the trapezoidal rule's, which keeps what oscillates, and Euler's implicit one, which
        damps what is stiff.
        """
        ng, mesh = self.ng, self.flow.space.mesh
        velocities = ng.VectorH1(mesh, order=self.order, **self._fixed(odd))
        space = velocities * ng.H1(mesh, order=self.order - 1)
        change, mass = disturbances(ng, space, self.flow.components[0], reynolds)
        change.AsVector().data -= SHIFT * mass.AsVector()
        inverse = change.Inverse(space.FreeDofs())
        state, heavy = change.CreateColVector(), change.CreateColVector()

        def shifted(vector):
            state.FV().NumPy()[:] = vector
            heavy.data = mass * state
            state.data = inverse * heavy
            return state.FV().NumPy().copy()

        def filtered(vector):
            return shifted(vector + 2 * SHIFT * shifted(vector))

        start = self.starts.get(odd)
        if start is None:
            start = shifted(np.random.default_rng(0).random(space.ndof))
        rates, self.starts[odd] = [], 0.0
        for vector in ritz_vectors(filtered, start):
            image = shifted(vector.real) + 1j * shifted(vector.imag)
            value = np.vdot(vector, image) / np.vdot(vector, vector)
            self.starts[odd] = self.starts[odd] + vector.real
            if np.linalg.norm(image - value * vector) < RESIDUAL * np.linalg.norm(image):
                rates.append(complex(SHIFT + 1 / value))
        return rates

    def _fixed(self, odd: str) -> dict[str, str]:
        """Where each component of a disturbance vanishes."""
        return {
            f"dirichlet{axis}": "|".join(
                [plane for plane in self.planes if (NORMALS[plane] == axis) != (plane == odd)]
                + [WALLS]
            )
            for axis in "xyz"
        }


def aligned(body: Mapping[str, float]) -> dict[str, float]:
    """Return the ellipsoid along the stream that is this one across it, or the body itself."""
    if body.get("incidence") != 90.0:
        return dict(body)
    aspect, flatness = body["aspect"], body.get("flatness", 1.0)
    return {"aspect": aspect**-0.5 * flatness**-0.75, "flatness": aspect * flatness**-0.5}


def ritz_vectors(apply: Any, start: np.ndarray) -> np.ndarray:
    """Return the Ritz vectors of the largest values of a linear map, one of each conjugate pair."""
    basis = [start / np.linalg.norm(start)]
    hessenberg = np.zeros((KRYLOV + 1, KRYLOV))
    for k in range(KRYLOV):
        new = apply(basis[k])
        for _ in range(2):  # twice is enough for orthogonality
            weights = np.array([known @ new for known in basis])
            hessenberg[: k + 1, k] += weights
            new = new - weights @ np.array(basis)
        hessenberg[k + 1, k] = np.linalg.norm(new)
        basis.append(new / hessenberg[k + 1, k])
    values, vectors = np.linalg.eig(hessenberg[:KRYLOV])
    largest = [k for k in np.argsort(-np.abs(values))[:RITZ] if values[k].imag >= 0]
    return vectors[:, largest].T @ np.array(basis[:KRYLOV])


def measure(run: Run, body: str, parameters: Mapping[str, float], mesh: str) -> Row:
    """Return the critical Re with its mode, or None where the search fails, and the body's sides.

    Args:
      run: How the study is run.
      body: Its name.
      parameters: Of the family, by name.
      mesh: Name of the mesh.
    """
    flow, onset = Disturbances(parameters, MESHES[run.pick("tiny", mesh)]), None
    guess = onset_of(family_shape(parameters, dimension=3))
    with contextlib.suppress(NotConverged):
        guesses = (share / guess for share in START)
        found = critical(lambda viscosity: flow.growth(1 / viscosity), *guesses, CLOSE / guess)
        onset = 1 / found
    return _described(flow, parameters) | {"onset": onset}


def growth(run: Run, body: str, parameters: Mapping[str, float], mesh: str) -> Row:
    """Return the growth rate, U / D, of the leading mode at one Re, and the sides of the body.

    Args:
      run: How the study is run.
      body: Its name.
      parameters: Of the family, by name.
      mesh: Name of the mesh.
    """
    flow = Disturbances(parameters, MESHES[run.pick("tiny", mesh)])
    rate = None
    with contextlib.suppress(NotConverged):
        rate = flow.growth(HIGHEST)
    return _described(flow, parameters) | {"reynolds": HIGHEST, "rate": rate}


def _described(flow: Disturbances, parameters: Mapping[str, float]) -> Row:
    length, width, height = family_shape(parameters, dimension=3).extent
    return {
        "length": length,
        "width": width,
        "height": height,
        "unknowns": flow.flow.space.ndof,
        "pulsation": abs(flow.leading.rate.imag),
        "plane": flow.leading.plane,
    }


SIDES = "body {body} | length {length:.2f} | width {width:.2f} | height {height:.2f}"
MODE = " | omega D / U {pulsation:.2f} | antisymmetric about {plane}"
MODE += " | mesh {mesh}, {unknowns} unknowns"
ONSETS = columns(
    f"{SIDES} | critical Re {{onset:.1f}}{MODE} | rule {{rule:.1f}} | error {{error:+.1%}}"
)
GROWTH = columns(
    f"{SIDES} | Re {{reynolds:g}} | growth rate {{rate:+.3f}}{MODE} | rule {{rule:.1f}}"
)
SEARCHED: tuple[tuple[dict[str, float], str], ...] = (
    ({"aspect": 0.5}, "usual"),
    ({"aspect": 0.3, "flatness": 2.0}, "usual"),
    ({"aspect": 0.3, "flatness": 2.0}, "finer"),
    ({"aspect": 0.5, "flatness": 2.0}, "usual"),
    ({"aspect": 0.3, "incidence": 45.0}, "usual"),
    ({"aspect": 0.3, "incidence": 20.0}, "usual"),
    ({"aspect": 0.3, "incidence": 70.0}, "usual"),
    ({"aspect": 0.5, "incidence": 45.0}, "usual"),
    ({"aspect": 0.5, "beta2": 0.2, "incidence": 30.0}, "usual"),
    ({"aspect": 0.5, "flatness": 2.0, "incidence": 30.0}, "usual"),
    ({"aspect": 2.0, "flatness": 2.0, "incidence": 60.0}, "usual"),
    ({"aspect": 3.0, "flatness": 2.0, "incidence": 45.0}, "usual"),
    ({"aspect": 0.7, "beta2": 0.2}, "usual"),
    ({"aspect": 0.7, "beta2": -0.2}, "usual"),
)
GROWTHS: tuple[tuple[dict[str, float], str], ...] = (
    ({"aspect": 4.0, "incidence": 90.0}, "usual"),
    ({"aspect": 3.0, "incidence": 45.0}, "usual"),
    ({"aspect": 1.5, "flatness": 2.0, "incidence": 45.0}, "usual"),
)


def _cases(bodies):
    return [{"body": name_of(body), "parameters": body, "mesh": mesh} for body, mesh in bodies]


def _shown(rows):
    """The rows with what the rule says; where no mode was found there is no frequency."""
    return [
        row
        | {
            "pulsation": row["pulsation"] if row["plane"] else None,
            "plane": ANTISYMMETRIC.get(row["plane"], row["plane"]),
        }
        for row in with_rule(rows)
    ]


TABLES = [
    Table(_cases(SEARCHED), measure, lambda rows: ONSETS(_shown(rows))),
    Table(_cases(GROWTHS), growth, lambda rows: GROWTH(_shown(rows)), key="growth"),
]
STUDIES = {"onset_incidence": Study(TABLES)}
