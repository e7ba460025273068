"""The bodies of least drag in space beside theory, and what a bound on their height makes of them.

python scripts/measure/least.py

At Re 0.01 Pironneau's body (1973; Bourot 1974: 0.95425 of the sphere's drag, tips of 120 degrees),
at Re 1 and 40 optima by axisymmetric elements. Every ratio is of flows on one grid.
"""

import dataclasses
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from literature import front_angles
from space import name_of
from study import Result, Study, run_study, words

from shapeopt import Problem, optimise
from shapeopt.render.bodies_3d import AHEAD, FRICTION, render_bodies, render_turntable
from shapeopt.render.pictures import Panel
from shapeopt.render.tables import markdown
from surrogate import Family, Fidelity, Flow, Scene, family_shape
from surrogate.flow.check.error_estimate import order
from surrogate.scene.fidelity import SPACE_FIDELITIES

THEORY = {0.01: 0.95425, 1.0: 0.94745, 40.0: 0.79645}
REVOLVED = Family(
    dimension=3,
    aspect=(1.0, 4.0),
    beta2=(-0.1, 0.1),
    beta3=(-0.15, 0.1),
    beta4=(-0.05, 0.05),
    beta5=(-0.05, 0.05),
)
LOW = {  # bodies whose height is bounded
    "aspect": (1.0, 6.0),
    "beta2": (-0.1, 0.1),
    "beta3": (-0.1, 0.15),
    "beta4": (-0.05, 0.05),
}
FLATTENED = Family(dimension=3, flatness=(1.0, 2.5), **LOW)
SLENDER = Family(dimension=3, **LOW)
HEIGHT = 0.55  # D, the bound
NODES = 400  # of the outline whose front is looked at
CELLS = 10, 16, 24  # per D
TINY = Fidelity("tiny", 5, 3, 4, 4, harmonics=4, wake=0.0, promise=0.1)


def measure(tiny: bool, progress: Callable) -> Result:
    """Optima over Re and cells; bounded ones."""
    standard = TINY if tiny else SPACE_FIDELITIES["standard"]
    numbers, cells = ((40.0,), (5,)) if tiny else (tuple(THEORY), CELLS)
    family = Family(dimension=3, aspect=(1.5, 3)) if tiny else REVOLVED
    rows = []
    for n in cells:  # of one scene, so that a grid is compiled once
        level = dataclasses.replace(standard, cells=n)
        scene = Scene(reynolds=(min(numbers), max(numbers)), family=family, fidelity=level)
        for reynolds in numbers:
            progress(len(rows) / (len(numbers) * len(cells) + 1), f"Re {reynolds:g}, {n} cells")
            rows.append({"cells": n, **_least(scene, reynolds)})
    low = {"flattened": FLATTENED, "of revolution": SLENDER}
    low = {"flattened": Family(dimension=3, aspect=(1.5, 3), flatness=(1, 2.5))} if tiny else low
    bounded = {}
    for name, family in low.items():
        progress(len(rows) / (len(numbers) * len(cells) + 1), f"{name}, {HEIGHT:g} D high")
        scene = Scene(reynolds=(40.0, 40.0), family=family, fidelity=standard)
        bounded[name] = _least(scene, 40.0, max_thickness=HEIGHT)
    return {
        "rows": rows,
        "theory": {f"{re:g}": THEORY[re] for re in numbers},
        "height": HEIGHT,
        "bounded": bounded,
    }


def _least(scene, reynolds, **bounds):
    """The flow's own optimum, and its drag over the sphere's."""
    flow = Flow(scene)
    design = optimise(Problem(scene, reynolds, **bounds), flow)
    sphere = float(flow.slope(scene.family.ellipse(1.0), reynolds).drag)
    return {
        "reynolds": reynolds,
        "ratio": design.objective / sphere,
        "parameters": scene.family.named(design.parameters),
        "kkt": design.kkt_residual,
        "flows": design.flows,
    }


def _extrapolated(rows, reynolds):
    """The ratio at no cell size, of the two finest grids, as drags are; None where there is one."""
    found = [(row["cells"], row["ratio"]) for row in rows if row["reynolds"] == reynolds]
    if len(found) < 2:
        return None
    (coarse, rough), (fine, good) = found[-2:]
    return good + (good - rough) / ((fine / coarse) ** order(reynolds, 3) - 1)


def tables(result: Result) -> str:
    """Ratios over cells, and the bounded optimum."""
    rows = []
    for re, theory in result["theory"].items():
        own = [row for row in result["rows"] if f"{row['reynolds']:g}" == re]
        body = name_of(own[-1]["parameters"], ".2f")
        last = _extrapolated(result["rows"], float(re))
        grids = ", ".join(f"{row['ratio']:.4f} ({row['cells']})" for row in own)
        outline = np.asarray(family_shape(own[-1]["parameters"], dimension=3).draw(NODES))
        tip = f"{front_angles(outline)[1]:.0f} degrees"
        extrapolated = "-" if last is None else f"{last:.4f}"
        rows.append([re, grids, extrapolated, f"{theory:.5f}", tip, body])
    head = (
        "Re",
        "drag over the sphere's (cells per D)",
        "extrapolated",
        "theory, elements",
        "front, continued to a tip",
        "body",
    )
    bounds = " ".join(_told(name, low, result["height"]) for name, low in result["bounded"].items())
    return f"{markdown(head, rows)}\n\n{bounds}"


def _told(name, bounded, height):
    """A bounded optimum in words."""
    form = (
        "At Re 40 and at most {height:g} D high the optimum {name} has {ratio:.4f} of the sphere's "
        "drag, aspect {aspect:.2f}"
    )
    body = {"flatness": 1.0} | bounded["parameters"]
    form += ", flatness {flatness:.2f}." if body["flatness"] > 1 else "."
    return words(form, height=height, name=name, ratio=bounded["ratio"], **body)


def draw(result: Result, path: Path) -> None:
    """Sphere, optimum and flattened one at Re 40, from two sides; over Re; a turntable."""
    flat = result["bounded"]["flattened"]["parameters"]
    optima = {row["reynolds"]: row["parameters"] for row in result["rows"]}
    bodies = {"least drag": optima[40.0], f"least drag, {result['height']:g} D high": flat}
    panels = _panels(40.0, bodies)
    render_bodies([panels], path)
    render_bodies([panels], path.with_name(f"{path.stem}_friction.png"), FRICTION)
    render_bodies([panels], path.with_name(f"{path.stem}_ahead.png"), FRICTION, AHEAD)
    render_turntable(panels[-1], path.with_name(f"{path.stem}_turning.gif"), FRICTION)
    over_re = [_panels(re, {"least drag": body}) for re, body in optima.items()]
    render_bodies(over_re, path.with_name(f"{path.stem}_over_re.png"))


def _panels(reynolds, bodies):
    """The sphere and others in their flows."""
    flow, panels, first = Flow(Scene(dimension=3, reynolds=(reynolds, reynolds))), [], None
    for name, body in {"sphere": {"aspect": 1.0}, **bodies}.items():
        found = flow.solve(family_shape(body, dimension=3), reynolds, estimate=False)
        first = first or found.drag
        change = "" if found.drag == first else f"    {100 * (found.drag / first - 1):+.1f} %"
        panels.append(Panel(found, f"Re {reynolds:g}    {name}    Cd {found.drag:.4g}{change}"))
    return panels


STUDY = Study("least", measure, tables, draw)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
