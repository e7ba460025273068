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
from onset_bodies import cases, shape_of, unseen_bodies
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, eigs, splu
from studies.onset import critical
from study import Result, Row, Run, Study, Table, columns, words
from tools import name_of
from weak_forms import CORNERS

from surrogate import Fidelity, Flow, NotConverged, Scene, Shape, family_shape
from surrogate.flow.check.march import Box, growth_rate, make_marcher, march, start
from surrogate.flow.wake import NEAR, WakeRule, onset_by_wake
from surrogate.scene.limits import REYNOLDS, onset_of

MESH = Elements(order=2, box=30.0, wall=0.06, near=0.15, wake=0.5)
COARSE = Elements(order=2, box=10.0, wall=0.2, near=0.5)
START = 0.867, 0.8  # 1 / Re times the guess: Re 1.15 and 1.25 times the guess, where modes grow
MOST = 330.0  # Re of a guess
CLOSE = 0.0067  # of 1 / Re, times the guess; secants lose an error of 1 % in one step
PULSATION = 0.74  # omega H / U near the onset, about; H is the height across the stream
AROUND = 0.9, 1.15  # of it, where the mode is sought at first
GROWTH = 0.12  # of the pulsation, of those shifts: the modes that decay are farther from them
MODES, KRYLOV = 3, 20
BOX = Box(cells=16)  # of marches; the time step is stable from Re 20.5
TINY_BOX = Box(cells=8, upstream=4.0, downstream=8.0, height=8.0, sponge=2.0, step=0.05)
DURATION, KICK = 100.0, 0.002  # D / U, and U: so little that the lift stays proportional to it
SHARES = 1.0, *NEAR  # Re over the rule's onset, of flows from which the onset is estimated
TOLERANCE = 1e-5  # of eigenvalues, relative to their distance from the shift


def measure(run: Run, body: str, parameters: Mapping[str, Any], fitted: bool | None) -> Row:
    """Return the critical Re and pulsation, or None where the search fails, and the body's sides.

    With the reverse flow of flows near the critical Re, see ``wakes``.

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
    found = {"length": length, "height": height, "onset": onset, "pulsation": pulsation}
    fidelity = run.fidelity("standard")
    return found | {"wake": None if onset is None else wakes(shape, fidelity)}


def wakes(body: Shape, fidelity: Fidelity) -> list[Row]:
    """Return Re and the speed of the reverse flow of steady flows near the rule's onset.

    They are at ``SHARES`` of it, as far as the flow solver is tested.

    Args:
      body: Whose flows they are.
      fidelity: Of the flows.
    """
    found, flow = [], Flow(Scene(fidelity=fidelity))
    for share in SHARES:
        reynolds = min(share * onset_of(body), REYNOLDS[2][1])
        solution = flow.solve(body, reynolds, estimate=False, allow_unsteady=True)
        found.append({"reynolds": reynolds, "speed": solution.reverse_speed})
    return found


def fit_wake(rows: Sequence[Row]) -> WakeRule:
    """Return the constants of the onset by the wake, from the rows of fitted bodies.

    The logarithm of the true onset over that of the rule, R, is linear in those of the speed and of
    Re for flows at R, which gives all but the weight of the outline. With that, an estimate is the
    same on average whatever the Re of its flow.
    """
    fitted = [row for row in rows if row["fitted"] and row["onset"] is not None]
    fitted = [row for row in fitted if row["wake"][-1]["reynolds"] < REYNOLDS[2][1]]
    flows = np.array([[(at["reynolds"], at["speed"]) for at in row["wake"]] for row in fitted])
    (at_rule, below, above), truth = np.log(flows).transpose(1, 2, 0), [r["onset"] for r in fitted]
    inputs = np.column_stack([-at_rule[1], -at_rule[0], np.ones(len(fitted))])
    (wake, fall, level), *_ = np.linalg.lstsq(inputs, np.log(truth) - at_rule[0])
    growth = np.mean((above[1] - below[1]) / (above[0] - below[0]))
    return WakeRule(1 - fall - wake * growth, wake, math.exp(level / wake), fall / wake)


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
    rate = growth_rate(np.asarray(force.lift), box.step)
    return {"reynolds": reynolds, "by_elements": by_elements, "marched": rate}


def against_rule(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with the onset of the flow solver's rule, and its error and the wake's."""
    found = []
    for row in rows:
        rule, onset = onset_of(shape_of(row["parameters"])), row["onset"]
        error = None if onset is None else rule / onset - 1
        wake = [None] * 3
        if onset is not None:
            flows = [(flow["reynolds"], rule, flow["speed"]) for flow in row["wake"]]
            wake = [onset_by_wake(*flow) / onset - 1 for flow in flows]
        use = unseen_bodies().get(row["body"], USES[row["fitted"]])
        found.append(row | {"rule": rule, "error": error, "by_wake": wake, "use": use})
    return found


def deviations(rows: Sequence[Row]) -> list[list[float]]:
    """Return the errors of the rule, and of the wake by each of its flows, for known onsets."""
    known = [[row["error"], *row["by_wake"]] for row in rows if row["onset"] is not None]
    return list(map(list, zip(*known, strict=True)))


def in_short(result: Result) -> str:
    """Return the README's sentence on the errors of the onset in %, on bodies unknown to it."""
    rows = [row for row in against_rule(result["rows"]) if row["onset"] is not None]
    blind = [row for row in rows if row["use"].startswith("blind")]
    both = [row for row in blind if row["use"] != "blind"]
    rule, wake = 100 * np.abs(deviations(blind)[0]), 100 * np.abs(deviations(both)[1])
    form = (
        "Shedding onset of {blind} blind bodies, by outline: {rule:.0f} rms, {most:.0f} at most; "
        "of {both}, by flow: {wake:.0f}, {far:.0f}."
    )
    root = {name: math.sqrt(np.mean(x**2)) for name, x in (("rule", rule), ("wake", wake))}
    counts = {"blind": len(blind), "both": len(both)}
    return words(form, most=max(rule), far=max(wake), **counts, **root)


def text(result: Result) -> str:
    """Return the bodies, the rule's errors, and the marches as tables and text."""
    rows = against_rule(result["rows"])
    parts = []
    for use in (*USES.values(), *dict.fromkeys(unseen_bodies().values())):
        mine = [row for row in rows if row["use"] == use and row["onset"] is not None]
        spread = map(_spread, deviations(mine)) if mine else ()
        parts += [{"use": use, "bodies": len(mine), "spread": list(spread)}] if mine else []
    off = max(abs(row["marched"] - row["by_elements"]) for row in result["marches"])
    return (
        f"{COLUMNS(rows)}\n\n{SPREADS(parts)}\n\n{MARCHES(result['marches'])}\n\n"
        f"The two rates differ by {off:.4f} U / D at most."
    )


def _spread(errors):
    """Return the range of errors and their root mean square, as text."""
    form = "{early:+.1%} to {late:+.1%}, {mean:.1%} rms"
    mean = math.sqrt(np.mean(np.square(errors)))
    return words(form, early=min(errors), late=max(errors), mean=mean)


USES = {True: "fitted", False: "not fitted", None: "extrapolated"}
COLUMNS = columns(
    "body {body} | length {length:.2f} | height {height:.2f} | critical Re {onset:.1f}"
    " | omega H / U {pulsation:.3f} | rule {rule:.1f} | error {error:+.1%}"
    " | by a flow at the rule's Re {by_wake[0]:+.1%} | "
    f"at {NEAR[0]:g} of it "
    + "{by_wake[1]:+.1%} | "
    + f"at {NEAR[1]:g} "
    + "{by_wake[2]:+.1%} | {use}"
)
SPREADS = columns(
    "{use} | bodies {bodies} | errors by the rule {spread[0]} | by a flow at the rule's Re"
    " {spread[1]} | "
    + f"at {NEAR[0]:g} of it "
    + "{spread[2]} | "
    + f"at {NEAR[1]:g} "
    + "{spread[3]}"
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
