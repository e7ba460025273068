"""Cd, Cl and Cm of cambered bodies at incidence against body-fitted finite elements."""

import functools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from error_bounds import bound_coverage
from lifting_elements import SECTION, ElementLoads, unbounded_loads
from study import Result, Row, Run, Study, Table, columns
from tools import LOADS, beside, name_of

from surrogate import FIDELITIES, Flow, Scene, contour_shape, family_shape, naca4

BODIES: tuple[tuple[dict[str, float], tuple[float, ...]], ...] = (
    ({"aspect": 1.5, "beta2": 0.15, "gamma2": 0.15, "incidence": 8.0}, (1.0, 40.0)),
    ({"aspect": 2.0, "incidence": 10.0}, (1.0, 20.0)),
    (
        {"aspect": 2.5, "beta2": 0.2, "beta3": 0.08, "gamma2": 0.25, "gamma3": -0.08}
        | {"incidence": -4.0},
        (5.0, 60.0),
    ),
    (
        {"aspect": 3.0, "beta2": 0.25, "beta3": 0.1, "gamma2": 0.2, "incidence": 5.0},
        (1.0, 40.0, 100.0),
    ),
    (
        {"aspect": 3.5, "beta2": -0.1, "beta4": 0.05, "gamma3": 0.1, "incidence": 12.0},
        (10.0, 60.0),
    ),
    (
        {"aspect": 4.0, "beta2": 0.25, "beta3": 0.1, "beta4": 0.04, "gamma2": 0.3}
        | {"incidence": 6.0},
        (1.0, 40.0, 150.0),
    ),
    (
        {"aspect": 5.0, "beta2": 0.2, "beta3": 0.05, "gamma2": 0.2, "gamma3": 0.08}
        | {"incidence": 15.0},
        (20.0, 100.0),
    ),
    ({"aspect": 6.0, "beta2": 0.3, "beta3": 0.1, "gamma2": 0.25, "incidence": 3.0}, (200.0,)),
)
CASES = [
    {"body": name_of(body), "parameters": body, "reynolds": reynolds, "fidelity": fidelity}
    for fidelity in ("standard", "fine")
    for body, numbers in BODIES
    for reynolds in numbers
]
# Cd and Cl by the chord at chord Re 1000 in a box of 15 chords, by Lethe (its documentation)
LETHE = {0.0: (0.1196, 0.0), 3.0: (0.1224, 0.159), 7.0: (0.135, 0.303)}
SECTIONS = [
    {"section": code, "incidence": turn, "chord_reynolds": reynolds}
    for code, turns in (("0012", LETHE), ("2412", (3.0,)))
    for turn in turns
    for reynolds in (100.0, 200.0, 500.0, 1000.0)
]
COARSE = SECTION._replace(box=20.0, wall=0.2, near=0.5)


def measure(
    run: Run, parameters: Mapping[str, float], reynolds: float, fidelity: str, **_: str
) -> Row:
    """Return the errors of the loads over Cd against elements, their bounds, and the work.

    Args:
      run: How the study is run.
      parameters: Of the body, by name.
      reynolds: U D / nu.
      fidelity: Its name.
      **_: The rest of the case.
    """
    shape = family_shape(parameters)
    found = Flow(Scene(fidelity=run.fidelity(fidelity))).solve(shape, reynolds, allow_unsteady=True)
    case = name_of(parameters), reynolds
    truth = _truth(run, case, lambda: _by_elements(tuple(parameters.items()), reynolds, run.tiny))
    row: Row = {"cells": round(1 / found.domain.lattice.step[0]), "seconds": found.seconds}
    return row | beside(found, truth)


def _truth(run, case, solve):
    """The loads by elements: those of the earlier record that the run is given, else solved."""
    earlier = run.options.get("elements")
    found = None if earlier is None else _recorded(earlier).get(case)
    return solve() if found is None else found


@functools.cache
def _recorded(path: Path) -> dict[tuple, ElementLoads]:
    """The loads by elements of a record's flows, by body and Re, and of sections by chord."""
    result, found = json.loads(path.read_text())["result"], {}
    for row in [*result["rows"], *result.get("wide", ())]:
        cd = row["cd"] / (1 + row["cd_error"])
        cl, cm = (row[name] - row[f"{name}_error"] * cd for name in ("cl", "cm"))
        found[row["body"], row["reynolds"]] = ElementLoads(cd, cl, cm)
    for row in result.get("sections", ()):
        case = row["section"], row["incidence"], row["chord_reynolds"]
        found[case] = ElementLoads(row["cd_elements"], row["cl_elements"], np.nan)
    return found


@functools.cache
def _by_elements(body: tuple, reynolds: float, tiny: bool) -> ElementLoads:
    return unbounded_loads(dict(body), reynolds, COARSE if tiny else SECTION)


def section(run: Run, section: str, incidence: float, chord_reynolds: float) -> Row:
    """Return the loads of a NACA section by its chord, by the flow and by elements, beside Lethe's.

    Args:
      run: How the study is run.
      section: Its four digits.
      incidence: In degrees.
      chord_reynolds: U c / nu.
    """
    shape = contour_shape(naca4(section), incidence)
    reynolds = chord_reynolds / shape.chord
    fidelity = run.pick("draft", "standard")  # the tiny domain is too short for a section
    found = Flow(Scene(fidelity=fidelity)).solve(shape, reynolds, allow_unsteady=True)

    def by_elements():
        loads = unbounded_loads(shape, reynolds, COARSE if run.tiny else SECTION)
        return ElementLoads(*(load / shape.chord for load in loads))

    by_chord = _truth(run, (section, incidence, chord_reynolds), by_elements)
    known = LETHE[incidence] if (section, chord_reynolds) == ("0012", 1000.0) else (None, None)
    return {
        "cd": found.drag / shape.chord,
        "cl": found.lift / shape.chord,
        "cd_elements": by_chord.cd,
        "cl_elements": by_chord.cl,
        "cd_lethe": known[0],
        "cl_lethe": known[1],
        "status": found.status,
    }


def text(result: Result) -> str:
    """Return tables of every flow, of the fidelities, and of the sections."""
    rows = result["rows"]
    return f"{FLOWS(rows)}\n\n{levels(rows)}\n\n{NACA(result['sections'])}"


def levels(rows: Sequence[Row]) -> str:
    """Return the errors of every fidelity and how many the bounds cover, as a table."""
    found = [
        _summary(level, [row for row in rows if row["fidelity"] == level]) for level in FIDELITIES
    ]
    return LEVELS([level for level in found if level["flows"]])


def _summary(level, rows):
    """Mean and largest errors of a fidelity over Cd, and how many the bounds cover."""
    summary = {"fidelity": level, "flows": len(rows)}
    for name in LOADS if rows else ():
        errors = np.abs([row[f"{name}_error"] for row in rows])
        summary |= {f"{name}_mean": errors.mean(), f"{name}_most": errors.max()}
        covered = bound_coverage([row[f"{name}_bound"] for row in rows], errors)
        summary |= {f"{name}_{key}": value for key, value in covered.items()}
    return summary


LOADS_TEXT = (
    "fidelity {fidelity} | cells per D {cells} | Cd {cd:.4f} | error {cd_error:+.2%}"
    " | Cl {cl:+.4f} | error over Cd {cl_error:+.2%} | Cm {cm:+.4f} | error over Cd {cm_error:+.2%}"
    " | status {status} | work {green_applications} G | seconds {seconds:.1f}"
)
FLOWS = columns(f"body {{body}} | Re {{reynolds:g}} | {LOADS_TEXT}")
LEVELS = columns(
    "fidelity {fidelity} | flows {flows} | Cd: mean error {cd_mean:.2%} | most {cd_most:.2%}"
    " | within its bound {cd_covered:.0%} | median bound over error {cd_ratio:.1f}"
    " | Cl: mean {cl_mean:.2%} | most {cl_most:.2%} | within its bound {cl_covered:.0%}"
    " | median bound over error {cl_ratio:.1f} | Cm: mean {cm_mean:.2%} | most {cm_most:.2%}"
    " | within its bound {cm_covered:.0%} | median bound over error {cm_ratio:.1f}"
)
NACA = columns(
    "NACA {section} | incidence {incidence:g} | chord Re {chord_reynolds:g} | Cd {cd:.4f}"
    " | elements {cd_elements:.4f} | Lethe {cd_lethe:.4f} | Cl {cl:+.4f}"
    " | elements {cl_elements:+.4f} | Lethe {cl_lethe:+.4f} | status {status}"
)
OPTIONS = {
    "--elements": {"type": Path, "help": "earlier record, whose loads by elements are taken"},
}
TABLES = [Table(CASES, measure), Table(SECTIONS, section, key="sections")]
STUDIES = {"lift": Study(TABLES, text, options=OPTIONS)}
