"""Bodies of least drag beside published ones and theory, in 2-D and 3-D.

In 3-D at Re 0.01 Pironneau's body (1973; Bourot 1974: 0.95425 of the sphere's drag, tips of 120
degrees), at Re 1 and 40 optima by axisymmetric elements. Every ratio is of flows on one grid.
"""

import dataclasses
import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from elements import unbounded_cd
from jaxtyping import Float
from scipy.optimize import root_scalar
from study import Result, Row, Run, Study, Table, cases, columns, words
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
from surrogate import Family, Fidelity, Flow, NotConverged, Scene, Solution, Tunnel, family_shape
from surrogate.flow.check.error_model import ERROR_MODELS
from surrogate.scene.fidelity import NAMED

# Chen, Cakal, Hu, Thuerey (J. Fluid Mech. 919, 2021), Re 1 in a finite domain: pressure, friction
ASPECT, CYLINDER, LENS = 2.5, (5.33, 5.36), (2.60, 7.54)
# Pironneau (J. Fluid Mech. 64, 1974): the front of a body of least drag is a wedge, in degrees
WEDGES = {0.1: 102.6, 1.0: 90.0, 40.0: 90.0}
# Body-fitted finite elements with their adjoint, six radial modes, a box of 60 D: fall of the drag
GAINS = {1.0: 4.5, 40.0: 25.1}
FRONT = (0.05, 0.15)  # share of the chord, behind the rounded nose, by which the wedge is measured
FRICTION_WHY = "friction comes from the wall vorticity, which errs more than Cd (study `constants`)"
PRESSURE = "pressure is the rest of the drag, so it takes over what friction lacks"
SURFACE = "pressure beside the wall, extrapolated to it: good to about 3 % of the drag"
TOTAL = "walls of another kind and distance: only the cylinder's drag was made equal"
UNBOUNDED = "; no walls here, and the published domain's add 3 to 4 %"
FLAT = "drag is flat in the aspect near the optimum; the published one is given as about 2.5"
SMALL = "two drags that are close; theirs, a level set, may have the sharp ends ours rounds off"
CORNER = "the family is a truncated sine series: it rounds the nose and has no corner"
VISCOUS = ", and a wedge of viscous size, D / 40, is below its reach and the grid's"
MODES = "the reference has other modes (six, radial) and a box of 60 D, ours four and aspect <= 5"

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
TINY = Fidelity("tiny", 5, 3, 4, 4, harmonics=4, wake=0.0, tolerance=0.1)
TINY_RANGES = {"dimension": 3, "aspect": (1.5, 3.0)}
FREE, WALLED = "unbounded", "tunnel"
PUBLISHED = cases(reynolds=[1.0], stream=(FREE, WALLED)) + cases(
    reynolds=(0.1, 40.0), stream=[FREE]
)


def beside_published(run: Run, reynolds: float, stream: str) -> list[Row]:
    """Compare the flow's own optimum and the cylinder with what is published."""
    fidelity, free = run.fidelity("standard"), stream == FREE
    walls = stream if free else tunnel_with_drag(fidelity, reynolds, sum(CYLINDER))
    flow = Flow(Scene(walls, reynolds=(0.1, 40.0), fidelity=fidelity))
    best = optimise(Problem(flow.scene, reynolds=reynolds), flow).parameters
    ellipse = flow.scene.family.ellipse(1.0)
    start, found = (flow.solve(body, reynolds, estimate=False) for body in (ellipse, best))
    lines = list(_front(reynolds, start, found)) if free else []
    if reynolds == 1.0:
        lines += _lens(f"Re 1, {walls}", float(best[0]), start, found, UNBOUNDED if free else "")
    return [row | {"stream": f"{walls}", "parameters": best} for row in lines]


def by_elements(run: Run, reynolds: float) -> list[Row]:
    """Compare with our elements what the optimum gains, and at Re 1 what another aspect costs.

    The other body is the best of the published aspect.
    """
    flow = Flow(Scene(reynolds=(0.1, 40.0), fidelity=run.fidelity("standard")))
    problem = Problem(flow.scene, reynolds)
    held = dataclasses.replace(problem, within={"aspect": (ASPECT, ASPECT)})

    def drags(body: Float[np.ndarray, " parameters"]) -> Float[np.ndarray, "2"]:
        """Return Cd of a body by the flow and by elements."""
        found = flow.solve(body, reynolds, estimate=False)
        return np.array([found.drag, unbounded_cd(found.shape.parameters, reynolds)])

    cylinder = drags(flow.scene.family.ellipse(1.0))
    best = drags(optimise(problem, flow).parameters)
    changes = {"gain of the optimum": 1 - best / cylinder}
    if reynolds == 1.0:
        other = drags(optimise(held, flow).parameters)
        changes[f"cost of aspect {ASPECT:g}"] = other / best - 1
    rows = zip(changes, *(100 * np.array(list(changes.values())).T), strict=True)
    return [{"quantity": name, "flow": ours, "elements": theirs} for name, ours, theirs in rows]


def line(quantity: str, ours: float, published: float, tolerance: float, why: str) -> Row:
    """Return the row of one comparison; numbers agree that differ by the tolerance at most.

    Args:
      quantity: Its name.
      ours: The number here.
      published: The number that is published.
      tolerance: Of their difference.
      why: The reason for a difference.
    """
    agrees = "yes" if abs(ours - published) <= tolerance else "no"
    numbers = {"ours": ours, "published": published, "tolerance": tolerance}
    return {"quantity": quantity, **numbers, "agrees": agrees, "why": why}


def _lens(where: str, aspect: float, start: Solution, found: Solution, why: str) -> Iterator[Row]:
    """Yield the lens beside the published one, with the differences that count as agreement."""
    gain = 100 * (1 - sum(LENS) / sum(CYLINDER))
    yield line(f"{where}: aspect", aspect, ASPECT, 0.25, FLAT)
    yield line(f"{where}: gain, %", 100 * (1 - found.drag / start.drag), gain, 0.5, SMALL)
    for name, ours, published, reason in (
        ("cylinder, pressure drag", start.drag_pressure, CYLINDER[0], PRESSURE),
        ("cylinder, friction drag", start.drag_friction, CYLINDER[1], FRICTION_WHY),
        ("optimum, pressure drag", found.drag_pressure, LENS[0], PRESSURE),
        ("optimum, pressure on the surface", found.surface().pressure_drag, LENS[0], SURFACE),
        ("optimum, friction drag", found.drag_friction, LENS[1], FRICTION_WHY),
        ("optimum, Cd", found.drag, sum(LENS), TOTAL),
    ):
        yield line(f"{where}: {name}", ours, published, 0.05 * published, reason + why)


def _front(re: float, start: Solution, found: Solution) -> Iterator[Row]:
    """Angles of the front to 10 degrees; the gain to half a percent of the drag."""
    why = CORNER + VISCOUS if re == 40.0 else CORNER
    tangent, wedge = front_angles(found.shape.draw(4000))
    yield line(f"Re {re:g}: front, tangent at 5-15 % chord, deg", tangent, WEDGES[re], 10, why)
    yield line(f"Re {re:g}: front, continued to the tip, deg", wedge, WEDGES[re], 10, why)
    if re in GAINS:
        name = f"Re {re:g}, body-fitted adjoint: gain, %"
        yield line(name, 100 * (1 - found.drag / start.drag), GAINS[re], 0.5, MODES)


def front_angles(markers: Float[np.ndarray, "nodes 2"]) -> tuple[float, float]:
    """Return the tip angles, in degrees, of the front of a symmetric contour from the nose on.

    A line through the points at 5 to 15 % of the chord gives the mean tangent. The front bends, so
    a parabola through the same points is followed to the centre line, where a sharp nose would be;
    of a lens of two arcs that meet at 90 degrees it reads 87.
    """
    upper = markers[: len(markers) // 2 + 1]
    station = upper[:, 0] - upper[0, 0]
    front = (station >= FRONT[0] * station[-1]) & (station <= FRONT[1] * station[-1])
    x, y = station[front], upper[front, 1]
    slope, parabola = np.polyfit(x, y, 1)[0], np.poly1d(np.polyfit(x, y, 2))
    tips = parabola.roots[np.isreal(parabola.roots)].real
    tip = tips[np.argmin(np.abs(tips))] if len(tips) else 0.0
    wedge = parabola.deriv()(tip)
    return tuple((2 * np.degrees(np.arctan([slope, wedge]))).tolist())


def tunnel_with_drag(fidelity: Fidelity, reynolds: float, target: float) -> Tunnel:
    """Return the tunnel with slip walls in which the cylinder has this drag, to 0.1 %.

    Raises:
      NotConverged: There is none.
    """

    def excess(blockage):  # in which the drag is nearly linear
        tunnel = Tunnel(round(1 / blockage, 1))
        return solved({"aspect": 1.0}, reynolds, fidelity, stream=tunnel).drag - target

    found = root_scalar(excess, x0=1 / 64, x1=1 / 96, method="secant", xtol=1e-4, maxiter=8)
    if not found.converged:
        raise NotConverged(f"no tunnel gives the cylinder Cd {target:g} at Re {reynolds:g}")
    return Tunnel(round(1 / found.root, 1))


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


LINES = columns(
    "quantity {quantity} | ours {ours:.2f} | published {published:.2f} | agrees {agrees}"
    " | reason for a difference {why}"
)
ELEMENTS = columns(
    "Re {reynolds:g} | quantity {quantity} | by the flow, % {flow:.3f}"
    " | by our elements {elements:.3f}"
)
TABLES = [Table(optima, optimum, show_optima), Table(bounded, optimum, key="bounded")]
STUDIES = {
    "literature": Study(
        [
            Table(PUBLISHED, beside_published, LINES),
            Table(cases(reynolds=list(GAINS)), by_elements, ELEMENTS, "elements"),
        ]
    ),
    "least": Study(
        TABLES,
        bounded_text,
        lambda run, result: {"bounded": {row["name"]: row for row in result["bounded"]}},
        draw,
    ),
}
