"""Bodies of least drag in 3-D beside theory.

At Re 0.01 Pironneau's body (1973; Bourot 1974: 0.95425 of the sphere's drag, tips of 120
degrees), at Re 1 and 40 optima by axisymmetric elements. Every ratio is of flows on one grid.
"""

import dataclasses
import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from studies.literature import front_angles
from study import Result, Row, Run, Study, Table, columns, words
from tools import name_of, solved

from shapeopt import Problem, optimise
from shapeopt.render.bodies_3d import (
    AHEAD,
    FRICTION,
    BodyPanel,
    render_bodies,
    render_turntable,
    solved_panel,
)
from shapeopt.render.pictures import Panel
from surrogate import Family, Fidelity, Flow, Scene, family_shape
from surrogate.flow.check.error_model import ERROR_MODELS
from surrogate.scene.fidelity import NAMED

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
TINY = Fidelity("tiny", 6, 3, 4, 4, harmonics=4, wake=0.0, tolerance=0.1)
TINY_RANGES = {"dimension": 3, "aspect": (1.5, 3.0)}


def optima(run: Run) -> Iterator[Row]:
    """Yield the cases over Re and cells; a tiny run has the optimum at Re 40."""
    level = run.pick(TINY, NAMED[3]["standard"])
    numbers, grids = run.pick(((40.0,), (5,)), (tuple(THEORY), CELLS))
    for n, reynolds in itertools.product(grids, numbers):
        fidelity, family = dataclasses.replace(level, cells=n), run.pick(TINY_RANGES, None)
        family = Family(**family) if family else REVOLVED
        scene = Scene(reynolds=(min(numbers), max(numbers)), family=family, fidelity=fidelity)
        yield {"cells": n, "reynolds": reynolds, "scene": scene}


def bounded(run: Run) -> Iterator[Row]:
    """Yield the cases at Re 40 under a bound on the height."""
    level = run.pick(TINY, NAMED[3]["standard"])
    tiny = {"flattened": Family(**TINY_RANGES, flatness=(1, 2.5))}
    for name, family in run.pick(tiny, BOUNDED).items():
        scene = Scene(reynolds=(40.0, 40.0), family=family, fidelity=level)
        yield {"name": name, "reynolds": 40.0, "scene": scene, "bounds": {"max_thickness": HEIGHT}}


def optimum(run, scene, reynolds, bounds=None, **_) -> Row:
    """Return the flow's own optimum, and its drag over the sphere's.

    Args:
      run: How the study is run.
      scene: Of the bodies.
      reynolds: U D / nu.
      bounds: Of the problem, by name.
      **_: The rest of the case.
    """
    flow = Flow(scene)
    design = optimise(Problem(scene, reynolds, **bounds or {}), flow)
    sphere = float(flow.loads_and_gradients(scene.family.ellipse(1.0), reynolds).drag)
    row = {"ratio": design.objective / sphere, "kkt": design.kkt_residual, "flows": design.flows}
    return row | {"parameters": scene.family.named(design.parameters)}


def _extrapolated(rows: list[Row]) -> float | None:
    """The limit of the ratio for fine cells, by the order of the drag, from the finest two."""
    if len(rows) < 2:
        return None
    coarse, fine = rows[-2:]
    growth = (fine["cells"] / coarse["cells"]) ** ERROR_MODELS[3].order(fine["reynolds"])
    return fine["ratio"] + (fine["ratio"] - coarse["ratio"]) / (growth - 1)


def show_optima(rows: list[Row]) -> str:
    """Return a table with one line per Reynolds number."""
    lines = []
    for re, theory in THEORY.items():
        if mine := [row for row in rows if row["reynolds"] == re]:
            grids = ", ".join(f"{row['ratio']:.4f} ({row['cells']})" for row in mine)
            body = mine[-1]["parameters"]
            tip = front_angles(np.asarray(family_shape(body, dimension=3).draw(400)))[1]
            line = {"theory": theory, "grids": grids, "limit": _extrapolated(mine), "tip": tip}
            lines.append(line | {"reynolds": re, "body": name_of(body, "z.2f")})
    return columns(
        "Re {reynolds:g} | drag over the sphere's (cells per D) {grids} | extrapolated {limit:.4f}"
        " | theory or elements {theory:.5f} | tip angle of the front {tip:.0f} degrees"
        " | body {body}"
    )(lines)


def bounded_text(result: Result) -> str:
    """Return a sentence on each optimum of bounded height."""
    form = (
        "At Re 40 and at most {height:g} D high the optimum {name} has {ratio:.4f} of the sphere's "
        "drag, aspect {aspect:.2f}"
    )
    sentences = []
    for name, row in result["bounded"].items():
        ends = ", flatness {flatness:.2f}." if row["parameters"].get("flatness", 1) > 1 else "."
        sentences.append(
            words(form + ends, height=HEIGHT, **row["parameters"], **row | {"name": name})
        )
    return " ".join(sentences)


def draw(result: Result, path: Path) -> None:
    """Draw sphere, optimum and flattened optimum at Re 40, from two sides; over Re; a turntable."""
    best = {row["reynolds"]: row["parameters"] for row in result["rows"]}
    flat = result["bounded"]["flattened"]["parameters"]
    panels = _panels(40.0, {"least drag": best[40.0], f"least drag, {HEIGHT:g} D high": flat})
    render_bodies([panels], path)
    render_bodies([panels], path.with_name(f"{path.stem}_friction.png"), FRICTION)
    render_bodies([panels], path.with_name(f"{path.stem}_ahead.png"), FRICTION, AHEAD)
    render_turntable(panels[-1], path.with_name(f"{path.stem}_turning.gif"), FRICTION)
    over_re = [_panels(re, {"least drag": body}) for re, body in best.items()]
    render_bodies(over_re, path.with_name(f"{path.stem}_over_re.png"))


def _panels(reynolds: float, bodies: dict[str, Row]) -> list[BodyPanel]:
    """The sphere and other bodies in their flows."""
    panels, sphere = [], None
    for name, body in {"sphere": {"aspect": 1.0}, **bodies}.items():
        found = solved(body, reynolds, NAMED[3]["standard"], 3)
        sphere = sphere or found.drag
        change = "" if name == "sphere" else f"    {100 * (found.drag / sphere - 1):+.1f} %"
        title = f"Re {reynolds:g}    {name}    Cd {found.drag:.4g}{change}"
        panels.append(solved_panel(Panel(found, title)))
    return panels


TABLES = [Table(optima, optimum, show_optima), Table(bounded, optimum, key="bounded")]
STUDIES = {
    "least": Study(
        TABLES,
        bounded_text,
        lambda run, result: {"bounded": {row["name"]: row for row in result["bounded"]}},
        draw,
    ),
}
