"""Critical Re at which the steady flow past a 2-D body loses its stability, and marches beside it.

There a disturbance of the plane flow neither grows nor decays.
"""

import contextlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from elements import continuation, ngsolve
from lifting_elements import raise_reynolds, section_at_rest
from meshes import Elements
from onset_bodies import blind_bodies, cases, shape_of
from scipy.signal import find_peaks
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, eigs, splu
from studies.onset import critical
from study import Result, Row, Run, Study, Table, columns, words
from tools import name_of
from weak_forms import CORNERS

from surrogate import NotConverged, Shape, family_shape
from surrogate.flow.check.march import Box, make_marcher, march, start
from surrogate.scene.limits import onset_of

MESH = Elements(order=2, box=30.0, wall=0.06, near=0.15, wake=0.5)
COARSE = Elements(order=2, box=10.0, wall=0.2, near=0.5)
START = 0.867, 0.8  # 1 / Re times the guess: Re 1.15 and 1.25 times the guess, where modes grow
MOST = 330.0  # Re of a guess
CLOSE = 0.0067  # of 1 / Re, times the guess; secants lose an error of 1 % in one step
PULSATION = 0.74  # omega h / U near the onset, about; h is the height across the stream
AROUND = 0.9, 1.15  # of it, where the mode is sought at first
GROWTH = 0.12  # of the pulsation, of those shifts: the modes that decay are farther from them
MODES, KRYLOV = 3, 20
BOX = Box(cells=16)  # of marches; the time step is stable from Re 20.5
TINY_BOX = Box(cells=8, upstream=4.0, downstream=8.0, height=8.0, sponge=2.0, step=0.05)
DURATION, KICK = 100.0, 0.002  # D / U, and U: so little that the lift stays proportional to it
TOLERANCE = 1e-5  # of eigenvalues, relative to their distance from the shift


def measure(run: Run, body: str, parameters: Mapping[str, Any], fitted: bool | None) -> Row:
    """Return the critical Re and pulsation, or None where the search fails, and the body's sides.

    Args:
      run: How the study is run.
      body: Its name.
      parameters: As for ``shape_of``.
      fitted: Whether the rule is fitted to it; None of one beyond those to which it is fitted.
    """
    shape, onset = shape_of(parameters), None
    length, height = np.ptp(shape.draw(400), axis=0)
    guess = min(onset_of(shape), MOST)
    wave = Disturbance(shape, run.pick(COARSE, MESH))
    with contextlib.suppress(NotConverged):
        guesses = (share / guess for share in START)
        found = critical(lambda viscosity: wave.growth(1 / viscosity), *guesses, CLOSE / guess)
        onset = 1 / found
    pulsation = None if onset is None else wave.mode.imag * height
    return {"length": length, "height": height, "onset": onset, "pulsation": pulsation}


class Disturbance:
    """The leading disturbance of the steady flow past a body, followed from Re to Re.

    It is at rest on the sides of the box, and the outlet is free of its traction.

    Raises:
      Unavailable: NGSolve is not installed.
    """

    def __init__(self, body: Shape, elements: Elements) -> None:
        self.ng = ngsolve()
        self.flow = section_at_rest(self.ng, body, elements)
        self.height = float(np.ptp(body.draw(400)[:, 1]))
        self.loads: np.ndarray | None = None
        self.mode = 0j

    def growth(self, reynolds: float) -> float:
        """Return the growth rate, U / D, at this Re."""
        if self.loads is None:
            self.loads = raise_reynolds(self.ng, self.flow, continuation(reynolds))
        else:
            self.loads = raise_reynolds(self.ng, self.flow, [reynolds], self.loads)
        equations = linearised(self.ng, self.flow, reynolds)
        if self.mode:
            found = modes(*equations, self.mode + GROWTH * self.mode.imag / 4, 1)
        else:
            sought = [PULSATION / self.height * share * (GROWTH + 1j) for share in AROUND]
            found = np.concatenate([modes(*equations, shift, MODES) for shift in sought])
        self.mode = found[np.argmax(found.real)]
        return float(self.mode.real)


def linearised(ng: Any, flow: Any, reynolds: float) -> tuple[csr_array, csr_array]:
    """Return A and M of M du/dt = A u, the disturbances of a flow, at the nodes that are free."""
    space = flow.space
    free = np.flatnonzero(list(space.FreeDofs()))
    matrices = []
    for matrix in disturbances(ng, space, flow.components[0], reynolds):
        rows, others, entries = map(np.array, matrix.COO())
        matrices.append(
            csr_array((entries, (rows, others)), shape=2 * (space.ndof,))[free][:, free]
        )
    return matrices[0], matrices[1]


def disturbances(ng: Any, space: Any, stream: Any, reynolds: float) -> tuple[Any, Any]:
    """Return A and M of M du/dt = A u, the disturbances of a flow in a space of elements.

    Args:
      ng: The package NGSolve.
      space: Of velocity and pressure of the disturbances.
      stream: Velocity of the flow.
      reynolds: U D / nu.
    """
    (u, p), (v, q) = space.TnT()
    viscous = ng.InnerProduct(ng.Grad(u), ng.Grad(v)) / reynolds
    inertia = (ng.Grad(u) * stream + ng.Grad(stream) * u) * v
    incompressible = p * ng.div(v) + q * ng.div(u) + CORNERS * p * q
    change, mass = ng.BilinearForm(space), ng.BilinearForm(space)
    change += (incompressible - viscous - inertia) * ng.dx
    mass += u * v * ng.dx
    return change.Assemble().mat, mass.Assemble().mat


def modes(change: csr_array, mass: csr_array, shift: complex, count: int) -> np.ndarray:
    """Return the eigenvalues nearest to a shift, by Arnoldi's method on the shifted inverse.

    Args:
      change: A.
      mass: M.
      shift: A complex rate.
      count: Number of eigenvalues.
    """
    solve = splu((change - shift * mass).tocsc()).solve
    inverse = LinearOperator(change.shape, matvec=solve, dtype=complex)
    return eigs(
        change.astype(complex),
        M=mass.astype(complex),
        OPinv=inverse,
        sigma=shift,
        k=count,
        ncv=KRYLOV,
        tol=TOLERANCE,
        v0=np.random.default_rng(0).random(change.shape[0]) + 0j,
        return_eigenvectors=False,
    )


def marched(run: Run, body: str, parameters: Mapping[str, float], share: float) -> Row:
    """Return growth rates, U / D, of the lift after a kick and of the leading disturbance.

    The first is marched in time, the second by elements.

    Args:
      run: How the study is run.
      body: Its name.
      parameters: Of the family, by name.
      share: Re over the rule's onset.
    """
    shape = family_shape(parameters)
    reynolds = share * onset_of(shape)
    by_elements = Disturbance(shape, run.pick(COARSE, MESH)).growth(reynolds)
    box, steps = run.pick((TINY_BOX, 400), (BOX, round(DURATION / BOX.step)))
    marcher = make_marcher(box, shape.draw(200), reynolds)
    _, force = march(box, marcher, start(box, KICK), steps)
    rate = envelope_rate(np.asarray(force.lift), box.step)
    return {"reynolds": reynolds, "by_elements": by_elements, "marched": rate}


def envelope_rate(lift: np.ndarray, step: float) -> float:
    """Return the rate at which the extremes of an oscillation grow, in its later half."""
    late = np.abs(lift[len(lift) // 2 :])
    peaks, _ = find_peaks(late)
    return float(np.polyfit(step * peaks, np.log(late[peaks]), 1)[0])


def against_rule(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with the onset of the flow solver's rule, and its error."""
    found = []
    for row in rows:
        rule, onset = onset_of(shape_of(row["parameters"])), row["onset"]
        error = None if onset is None else rule / onset - 1
        use = "blind" if row["body"] in blind_bodies() else USES[row["fitted"]]
        found.append(row | {"rule": rule, "error": error, "use": use})
    return found


def in_short(result: Result) -> str:
    """Return the README's sentence on the error of the rule in %, over all bodies."""
    errors = [abs(row["error"]) for row in against_rule(result["rows"]) if row["error"] is not None]
    mean = math.sqrt(np.mean(np.square(errors)))
    form = "Shedding onset: {mean:.0f} rms, {most:.0f} at most."
    return words(form, mean=100 * mean, most=100 * max(errors))


def text(result: Result) -> str:
    """Return the bodies, the rule's errors, and the marches as tables and text."""
    rows = against_rule(result["rows"])
    parts = []
    for use in (*USES.values(), "blind"):
        errors = [row["error"] for row in rows if row["use"] == use and row["error"] is not None]
        if errors:
            mean = math.sqrt(np.mean(np.square(errors)))
            form = "{use}: {n} bodies, error {early:+.1%} to {late:+.1%}, {mean:.1%} rms"
            ends = {"early": min(errors), "late": max(errors)}
            parts.append(words(form, use=use, n=len(errors), mean=mean, **ends))
    off = max(abs(row["marched"] - row["by_elements"]) for row in result["marches"])
    return (
        f"{COLUMNS(rows)}\n\n{'; '.join(parts)}\n\n{MARCHES(result['marches'])}\n\n"
        f"The two rates differ by {off:.4f} U / D at most."
    )


USES = {True: "fitted", False: "not fitted", None: "extrapolated"}
COLUMNS = columns(
    "body {body} | length {length:.2f} | height {height:.2f} | critical Re {onset:.1f}"
    " | omega h / U {pulsation:.3f} | rule {rule:.1f} | error {error:+.1%} | {use}"
)
MARCHES = columns(
    "body {body} | Re {reynolds:.1f} | over the rule's {share:g} | growth rate, elements"
    " {by_elements:+.4f} | marched {marched:+.4f}"
)
BESIDE = [
    {"body": name_of(body), "parameters": body, "share": share}
    for body in ({"aspect": 0.5}, {"aspect": 2.0})
    for share in (0.85, 1.2)
]
TABLES = [Table(lambda run: cases(), measure), Table(BESIDE, marched, key="marches")]
STUDIES = {"onset_2d": Study(TABLES, text)}
