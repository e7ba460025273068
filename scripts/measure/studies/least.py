"""The bodies of least drag in 3-D beside theory, and under a bound on their height.

At Re 0.01 Pironneau's body (1973; Bourot 1974: 0.95425 of the sphere's drag, tips of 120 degrees),
at Re 1 and 40 optima by axisymmetric elements. Every ratio is of flows on one grid.
"""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from studies.literature import front_angles
from study import Result, Row, Run, Study, Table, columns, words
from tools import name_of, solved

from shapeopt import Problem, optimise
from shapeopt.render.bodies_3d import AHEAD, FRICTION, render_bodies, render_turntable
from shapeopt.render.pictures import Panel
from surrogate import Family, Fidelity, Flow, Scene, family_shape
from surrogate.flow.check.error_estimate import order
from surrogate.scene.fidelity import SPACE_FIDELITIES

THEORY = {0.01: 0.95425, 1.0: 0.94745, 40.0: 0.79645}  # drag over the sphere's
BETAS = {"beta2": (-0.1, 0.1), "beta3": (-0.15, 0.1), "beta4": (-0.05, 0.05)}
REVOLVED = Family(dimension=3, aspect=(1.0, 4.0), **BETAS, beta5=(-0.05, 0.05))
LOW = {"aspect": (1.0, 6.0)} | BETAS | {"beta3": (-0.1, 0.15)}  # of bodies of bounded height
BOUNDED = {
    "flattened": Family(dimension=3, flatness=(1.0, 2.5), **LOW),
    "of revolution": Family(dimension=3, **LOW),
}
HEIGHT = 0.55  # D, the bound
CELLS = 10, 16, 24  # per D
TINY = Fidelity("tiny", 5, 3, 4, 4, harmonics=4, wake=0.0, promise=0.1)
TINY_FAMILY = {"dimension": 3, "aspect": (1.5, 3.0)}


def cases(run: Run) -> Iterator[Row]:
    """Optima over Re and cells; a tiny run has the one at Re 40."""
    level = run.pick(TINY, SPACE_FIDELITIES["standard"])
    family = run.pick(Family(**TINY_FAMILY), REVOLVED)
    for n in run.pick((5,), CELLS):
        fidelity = dataclasses.replace(level, cells=n)
        numbers = run.pick((40.0,), tuple(THEORY))
        scene = Scene(reynolds=(min(numbers), max(numbers)), family=family, fidelity=fidelity)
        for reynolds in numbers:
            yield {"cells": n, "reynolds": reynolds, "scene": scene}


def bounded(run: Run) -> Iterator[Row]:
    """Optima of bounded height at Re 40."""
    level = run.pick(TINY, SPACE_FIDELITIES["standard"])
    tiny = {"flattened": Family(**TINY_FAMILY, flatness=(1, 2.5))}
    for name, family in run.pick(tiny, BOUNDED).items():
        scene = Scene(reynolds=(40.0, 40.0), family=family, fidelity=level)
        yield {"name": name, "reynolds": 40.0, "scene": scene, "bounds": {"max_thickness": HEIGHT}}


def measure(run, scene, reynolds, bounds=None, **_) -> Row:
    """The flow's own optimum, and its drag over the sphere's."""
    flow = Flow(scene)
    design = optimise(Problem(scene, reynolds, **bounds or {}), flow)
    sphere = float(flow.slope(scene.family.ellipse(1.0), reynolds).drag)
    return {
        "ratio": design.objective / sphere,
        "parameters": scene.family.named(design.parameters),
        "kkt": design.kkt_residual,
        "flows": design.flows,
    }


def _extrapolated(rows: list[Row]) -> float | None:
    """The limit of the ratio for fine cells, by the order of the drag, from the finest two."""
    if len(rows) < 2:
        return None
    coarse, fine = rows[-2:]
    growth = (fine["cells"] / coarse["cells"]) ** order(fine["reynolds"], 3)
    return fine["ratio"] + (fine["ratio"] - coarse["ratio"]) / (growth - 1)


def show(rows: list[Row]) -> str:
    """One line per Reynolds number."""
    lines = []
    for re, theory in THEORY.items():
        mine = [row for row in rows if row["reynolds"] == re]
        for row in mine[-1:]:
            grids = ", ".join(f"{own['ratio']:.4f} ({own['cells']})" for own in mine)
            body = row["parameters"]
            tip = front_angles(np.asarray(family_shape(body, dimension=3).draw(400)))[1]
            line = {"theory": theory, "grids": grids, "limit": _extrapolated(mine), "tip": tip}
            lines.append(row | line | {"body": name_of(body, ".2f")})
    return columns(
        "Re {reynolds:g} | drag over the sphere's (cells per D) {grids} | extrapolated {limit:.4f}"
        " | theory or elements {theory:.5f} | tip angle of the front {tip:.0f} degrees"
        " | body {body}"
    )(lines)


def text(result: Result) -> str:
    """The optima of bounded height."""
    form = (
        "At Re 40 and at most {height:g} D high the optimum {name} has {ratio:.4f} of the sphere's "
        "drag, aspect {aspect:.2f}"
    )
    told = []
    for name, row in result["bounded"].items():
        body = row["parameters"]
        ends = ", flatness {flatness:.2f}." if body.get("flatness", 1.0) > 1 else "."
        told.append(words(form + ends, height=HEIGHT, name=name, ratio=row["ratio"], **body))
    return " ".join(told)


def draw(result: Result, path: Path) -> None:
    """Sphere, optimum and flattened optimum at Re 40, from two sides; over Re; a turntable."""
    optima = {row["reynolds"]: row["parameters"] for row in result["rows"]}
    flat = result["bounded"]["flattened"]["parameters"]
    bodies = {"least drag": optima[40.0], f"least drag, {HEIGHT:g} D high": flat}
    panels = _panels(40.0, bodies)
    render_bodies([panels], path)
    render_bodies([panels], path.with_name(f"{path.stem}_friction.png"), FRICTION)
    render_bodies([panels], path.with_name(f"{path.stem}_ahead.png"), FRICTION, AHEAD)
    render_turntable(panels[-1], path.with_name(f"{path.stem}_turning.gif"), FRICTION)
    over_re = [_panels(re, {"least drag": body}) for re, body in optima.items()]
    render_bodies(over_re, path.with_name(f"{path.stem}_over_re.png"))


def _panels(reynolds: float, bodies: dict[str, Row]) -> list[Panel]:
    """The sphere and other bodies in their flows."""
    panels, sphere = [], None
    for name, body in {"sphere": {"aspect": 1.0}, **bodies}.items():
        found = solved(body, reynolds, SPACE_FIDELITIES["standard"], 3)
        sphere = sphere or found.drag
        change = "" if name == "sphere" else f"    {100 * (found.drag / sphere - 1):+.1f} %"
        panels.append(Panel(found, f"Re {reynolds:g}    {name}    Cd {found.drag:.4g}{change}"))
    return panels


STUDY = Study(
    [Table(cases, measure, show), Table(bounded, measure, key="bounded")],
    text,
    extra=lambda run, result: {"bounded": {row["name"]: row for row in result["bounded"]}},
    draw=draw,
)
