"""Cd, Cl and Cm of 3-D bodies at incidence: elements in space, Oberbeck's Stokes flow, and cost."""

import functools
from collections.abc import Mapping

import numpy as np
from correlations import ellipsoid, oberbeck
from elements import BOX
from lifting_elements import ElementLoads, loads_in_space
from studies.accuracy_3d import SPHERE
from study import Result, Row, Run, Study, Table, cases, columns
from tools import LOADS, alone, beside, mean_and_most, medians, name_of, relative_error

from surrogate import Flow, Scene, family_shape
from surrogate.flow.check.error_estimate import NO_LIFT

# held out: no constant of the flow is fitted to them
FLOWS: tuple[tuple[dict[str, float], float], ...] = (
    ({"aspect": 0.5, "incidence": 30.0}, 10.0),
    ({"aspect": 0.6, "incidence": 60.0}, 30.0),
    ({"aspect": 2.5, "incidence": 20.0}, 50.0),
    ({"aspect": 2.0, "incidence": 70.0}, 20.0),
    ({"aspect": 3.0, "incidence": 90.0}, 5.0),
    ({"aspect": 2.0, "beta2": 0.25, "incidence": 45.0}, 1.0),
    ({"aspect": 1.5, "beta2": -0.2, "incidence": 60.0}, 40.0),
    ({"aspect": 2.0, "flatness": 1.8, "incidence": 30.0}, 20.0),
    ({"aspect": 1.2, "flatness": 2.0, "beta2": 0.15, "incidence": 50.0}, 10.0),
    ({"aspect": 2.0, "incidence": 45.0}, 100.0),
    ({"aspect": 0.6, "incidence": 45.0}, 100.0),
)
QUADRATIC = BOX._replace(wall=0.2, near=0.5, wake=1.2)
CUBIC = BOX._replace(order=3, wall=0.3, near=0.7, wake=1.6)
COARSE = BOX._replace(box=10.0, wall=0.3, near=0.7, wake=1.5)
ELLIPSOIDS = cases(aspect=(0.5, 2.0, 3.0), flatness=[1.0], incidence=(30.0, 45.0, 90.0))
ELLIPSOIDS += cases(aspect=(0.8, 2.0), flatness=[2.0], incidence=(30.0, 45.0, 90.0))
CASES = [
    {"body": name_of(body), "parameters": body, "reynolds": re, "fidelity": "standard"}
    for body, re in FLOWS
]
FASTEST = [
    {"body": name_of(body), "parameters": body, "reynolds": re}
    for body, re in (
        ({"aspect": 2.0, "incidence": 30.0}, 150.0),
        ({"aspect": 0.7, "incidence": 60.0}, 120.0),
    )
]
CREEPING = 1e-3  # Re at which inertia adds less than 0.05 % to the drag, half of it known
PAIRS = cases(aspect=(1.5, 2.0, 3.0), reynolds=(1.0, 10.0, 40.0))
COSTS = cases(fidelity=("draft", "standard"), aspect=(0.6, 2.0), reynolds=(1.0, 40.0))


def measure(run: Run, parameters: Mapping[str, float], reynolds: float, fidelity: str, **_) -> Row:
    """Return the errors of the loads over Cd against elements, their bounds, and the work.

    Args:
      run: How the study is run.
      parameters: Of the body, by name.
      reynolds: U D / nu.
      fidelity: Its name.
      **_: The rest of the case.
    """
    shape = family_shape(parameters, dimension=3)
    flow = Flow(Scene(dimension=3, fidelity=run.fidelity(fidelity, 3)))
    found = flow.solve(shape, reynolds, allow_unsteady=True)
    truth = _by_elements(tuple(parameters.items()), reynolds, run.tiny)
    return beside(found, truth)


def elements(run: Run, parameters: Mapping[str, float], reynolds: float, degree: int, **_) -> Row:
    """Return the sphere's Cd by elements of second or third degree, and by the flow.

    Args:
      run: How the study is run.
      parameters: Of the body, by name.
      reynolds: U D / nu.
      degree: Of the elements, 2 or 3.
      **_: The rest of the case.
    """
    mesh = run.pick(COARSE, CUBIC if degree == 3 else QUADRATIC)
    found = loads_in_space(dict(parameters), reynolds, mesh).cd
    flow = Flow(Scene(dimension=3, fidelity=run.fidelity("standard", 3)))
    shape = family_shape(parameters, dimension=3)
    own = flow.solve(shape, reynolds, estimate=False, allow_unsteady=True).drag
    exact = SPHERE[reynolds] if parameters == {"aspect": 1.0} else None
    return {
        "cd": found,
        "elements_error": relative_error(found, exact),
        "flow": own,
        "flow_error": relative_error(own, exact),
        "difference": own / found - 1,
    }


@functools.cache
def _by_elements(body: tuple, reynolds: float, tiny: bool) -> ElementLoads:
    return loads_in_space(dict(body), reynolds, COARSE if tiny else CUBIC)


def stokes(run: Run, aspect: float, flatness: float, incidence: float) -> Row:
    """Return errors over Cd in Stokes flow, by Oberbeck's drags along the axis and across it.

    These two are superposed at an incidence.
    """
    level = run.fidelity("standard", 3)
    given = {"aspect": aspect, "flatness": flatness, "incidence": incidence}
    shape = family_shape(given, dimension=3)
    found = Flow(Scene(dimension=3, fidelity=level)).solve(shape, CREEPING, estimate=False)
    body = ellipsoid(aspect, flatness)
    along, across = (oberbeck(one, CREEPING) for one in (body, body.turned))
    cosine, sine = np.cos(np.deg2rad(incidence)), np.sin(np.deg2rad(incidence))
    drag, lift = along * cosine**2 + across * sine**2, (across - along) * sine * cosine
    return {
        "cd": found.drag,
        "cd_error": found.drag / drag - 1,
        "cl_error": (found.lift - lift) / drag,
        "cm_error": found.moment / drag,
    }


def across(run: Run, aspect: float, reynolds: float) -> Row:
    """Compare a spheroid across the stream on half of the domain with the same one on a quarter."""
    flow = Flow(Scene(dimension=3, fidelity=run.fidelity("standard", 3)))
    turned = {"aspect": aspect, "incidence": 90.0}
    aligned = {"aspect": aspect**-0.5, "flatness": aspect}
    by_half, by_quarter = (
        flow.solve(family_shape(body, dimension=3), reynolds, estimate=False, allow_unsteady=True)
        for body in (turned, aligned)
    )
    return {
        "cd": by_half.drag,
        "difference": by_half.drag / by_quarter.drag - 1,
        "cells": np.prod(by_half.domain.lattice.shape) / np.prod(by_quarter.domain.lattice.shape),
        "work": by_half.green_applications,
        "aligned_work": by_quarter.green_applications,
    }


def against_fine(run: Run, parameters: Mapping[str, float], reynolds: float, **_) -> Row:
    """Return the loads on the standard grid, and their errors over Cd against the fine grid.

    Args:
      run: How the study is run.
      parameters: Of the body, by name.
      reynolds: U D / nu.
      **_: The rest of the case.
    """
    shape = family_shape(parameters, dimension=3)
    found, fine = (
        Flow(Scene(dimension=3, fidelity=run.fidelity(name, 3))).solve(
            shape, reynolds, estimate=name == "standard"
        )
        for name in ("standard", "fine")
    )
    return beside(found, (fine.drag, fine.lift, fine.moment))


def cost(run: Run, fidelity: str, aspect: float, reynolds: float) -> Row:
    """Compare the seconds of a flow at an incidence with those without; medians, no compilation.

    Args:
      run: How the study is run.
      fidelity: Its name.
      aspect: Of the spheroid.
      reynolds: U D / nu.
    """
    flow = Flow(Scene(dimension=3, fidelity=run.fidelity(fidelity, 3)))
    aligned, turned = (
        family_shape({"aspect": aspect, "incidence": turn}, dimension=3) for turn in (0.0, 30.0)
    )

    solve = functools.partial(flow.solve, reynolds=reynolds, estimate=False)
    calls = [functools.partial(alone, functools.partial(solve, x)) for x in (aligned, turned)]
    found = [call() for call in calls]
    before, after = medians(calls, run.pick(1, 5))
    return {
        "aligned_work": found[0].green_applications,
        "work": found[1].green_applications,
        "aligned_s": before,
        "seconds": after,
        "ratio": after / before,
    }


def text(result: Result) -> str:
    """Return the mean and largest errors of the held-out flows as text.

    Bounds of lift and moment that vanish by symmetry are not counted: they are 0 but for rounding,
    and what is left is the error of the elements.
    """
    rows = result["rows"]
    parts = []
    for name, symbol in zip(LOADS, ("Cd", "Cl", "Cm"), strict=True):
        mean, most = mean_and_most([row[f"{name}_error"] for row in rows])
        known = [row for row in rows if (row[f"{name}_bound"] or 0.0) > NO_LIFT]
        covered = sum(row[f"{name}_bound"] >= abs(row[f"{name}_error"]) for row in known)
        parts.append(
            f"{symbol} {100 * mean:.2f} % on average and {100 * most:.2f} % at most, {covered} of "
            f"{len(known)} within their bounds"
        )
    return f"Errors over Cd of the {len(rows)} held-out flows: {'; '.join(parts)}."


HELD_OUT = columns(
    "body {body} | Re {reynolds:g} | Cd {cd:.4f} | error {cd_error:+.2%} | Cl {cl:+.4f}"
    " | error over Cd {cl_error:+.2%} | Cm {cm:+.4f} | error over Cd {cm_error:+.2%}"
    " | status {status} | work {green_applications} G"
)
STOKES = columns(
    "aspect {aspect:g} | flatness {flatness:g} | incidence {incidence:g} | Cd at Re 0.001 {cd:.1f}"
    " | error by Oberbeck {cd_error:+.2%} | of Cl, over Cd {cl_error:+.2%} | of Cm {cm_error:+.2%}"
)
ACROSS = columns(
    "aspect {aspect:g}, across the stream; Re {reynolds:g} | Cd {cd:.4f}"
    " | difference to the same body on a quarter {difference:+.3%} | work {work} G"
    " | on a quarter {aligned_work} G"
)
FAST = columns(
    "body {body} | Re {reynolds:g} | Cd {cd:.4f} | against the fine grid {cd_error:+.2%}"
    " | bound {cd_bound:.2%} | Cl {cl:+.4f} | over Cd {cl_error:+.2%} | bound {cl_bound:.2%}"
    " | Cm {cm:+.4f} | over Cd {cm_error:+.2%} | bound {cm_bound:.2%} | status {status}"
    " | work {green_applications} G"
)
COST = columns(
    "fidelity {fidelity} | aspect {aspect:g} | Re {reynolds:g} | aligned {aligned_work} G, "
    "{aligned_s:.2f} s | at 30 degrees {work} G, {seconds:.2f} s | ratio of seconds {ratio:.2f}"
)
ELEMENTS = columns(
    "body {body} | Re {reynolds:g} | degree {degree} | Cd by elements {cd:.4f}"
    " | their error {elements_error:+.2%} | Cd by the flow {flow:.4f} | its error {flow_error:+.2%}"
    " | flow against elements {difference:+.2%}"
)
SPHERES = [
    {"body": name_of(body), "parameters": body, "reynolds": re, "degree": degree}
    for body, re, degree in (
        ({"aspect": 1.0}, 10.0, 2),
        ({"aspect": 1.0}, 40.0, 2),
        ({"aspect": 1.0}, 10.0, 3),
        ({"aspect": 1.0}, 40.0, 3),
        ({"aspect": 1.0}, 100.0, 3),
    )
]
STUDIES = {
    "incidence": Study(
        [
            Table(ELLIPSOIDS, stokes, STOKES),
            Table(PAIRS, across, ACROSS, key="across"),
            Table(COSTS, cost, COST, key="cost"),
            Table(FASTEST, against_fine, FAST, key="fastest"),
        ],
    ),
    "incidence_elements": Study([Table(CASES, measure, HELD_OUT)], text),
    "elements_in_space": Study([Table(SPHERES, elements, ELEMENTS)]),
}
