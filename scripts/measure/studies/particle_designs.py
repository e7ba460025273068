"""Designs of particles at optima of the flow: at an angle, tumbling, and settling fast.

With pictures: pressure on each body beside the sphere, streamlines in the plane of symmetry, and
the first body turned.
"""

import dataclasses
from pathlib import Path

from study import Result, Row, Run, Study, Table, cases, columns
from tools import name_of

from shapeopt import Designer, Problem, Settling, Tumbling
from shapeopt.render.bodies_3d import render_bodies, render_turntable, solved_panel
from shapeopt.render.pictures import Panel
from shapeopt.search.optimality import KKT_ACCEPTED, KKT_TOLERANCE
from surrogate import Flow, Scene, family_shape, load
from surrogate.flow.output.folder import flow_as_stored
from surrogate.flow.output.picture import draw_flows

NAME, REYNOLDS, ARCHIMEDES = "pretrained:particle", 40.0, 1000.0
SHOWN = 30.0  # degrees, the incidence at which a body that tumbles is drawn
# With the ranges of parameters that each problem narrows. ``Tumbling`` averages over the
# orientations with the nose ahead: those are all where the body is alike fore and aft.
OBJECTIVES = {
    "least drag at 30 degrees": (REYNOLDS, {"incidence": (30.0, 30.0)}),
    "least mean drag": (Tumbling(REYNOLDS), {"beta2": (0.0, 0.0)}),
    "least mean drag, prolate": (Tumbling(REYNOLDS), {"beta2": (0.0, 0.0), "aspect": (1.5, 4.0)}),
    "fastest at 90 degrees": (Settling(ARCHIMEDES), {"incidence": (90.0, 90.0)}),
}
SPHERE = {"flatness": (1.0, 1.0), "beta2": (0.0, 0.0), "aspect": (1.0, 1.0)}
PROLATE = SPHERE | {"aspect": (1.0, 2.0)}  # the bodies of tiny runs


def design(run: Run, objective: str) -> Row:
    """Return an optimum of the flow, and the sphere's answer to the same objective."""
    net, (asked, within) = load(NAME), OBJECTIVES[objective]
    coarse = dataclasses.replace(net.scene.fidelity, cells=5)
    model = run.pick(Flow(dataclasses.replace(net.scene, fidelity=coarse)), net)
    designer, family = Designer(model), net.scene.family
    narrow = within | run.pick(PROLATE, {})
    found = designer.design(Problem(model.scene, asked, within=narrow))
    sphere = Designer(model).design(Problem(model.scene, asked, within=within | SPHERE))
    return {
        "reynolds": found.problem.objective.nominal,
        "parameters": family.named(found.parameters),
        "value": found.objective,
        "sphere_reynolds": sphere.problem.objective.nominal,
        "sphere": sphere.objective,
        "flows": found.flows,
        "kkt": found.kkt_residual,
    }


def draw(result: Result, path: Path) -> None:
    """Draw every design and the sphere beside it, the designs' flows, and the first one turned."""
    flow = Flow(Scene(dimension=3))
    rows, pictures = [], []
    for row in result["rows"]:
        held = OBJECTIVES[row["objective"]][1].get("incidence", (SHOWN, SHOWN))[0]
        body = row["parameters"] | {"incidence": held}
        panels = []
        for name, shape in (("sphere", {"aspect": 1.0}), (row["objective"], body)):
            found = flow.solve(family_shape(shape, dimension=3), row["reynolds"], estimate=False)
            title = f"Re {found.reynolds:.3g}    {name}    Cd {found.drag:.4g}"
            panels.append(solved_panel(Panel(found, title)))
        rows.append(panels)
        pictures.append(flow_as_stored(found).picture._replace(title=title))
    render_bodies(rows, path)
    draw_flows(pictures, path.with_name(f"{path.stem}_flows.png"))
    render_turntable(rows[0][-1], path.with_name(f"{path.stem}_turning.gif"))


TABLE = columns(
    "objective {objective} | Re {reynolds:.4g} | body {parameters} | value {value:.4f}"
    " | the sphere's Re {sphere_reynolds:.4g} | value {sphere:.4f}"
    " | flows {flows} | KKT residual {kkt:.0e}"
)


def show(rows: list[Row]) -> str:
    """Return the table, each body as text."""
    return TABLE([row | {"parameters": name_of(row["parameters"], ".3f")} for row in rows])


STUDIES = {
    "particle_designs": Study(
        [Table(cases(objective=OBJECTIVES), design, show)],
        f"Led by `{NAME}`. A KKT residual above {KKT_TOLERANCE:g} is accepted up to "
        f"{KKT_ACCEPTED:g} where flows lead to no better body. The body of least mean drag over "
        "all orientations that was found is nearly the sphere; prolate bodies have an aspect of "
        "1.5 at least. Where an incidence is given the body is held there, as by a torque from "
        "outside; at 90 degrees the axis is across the stream. The value is Cd, its mean over all "
        "orientations, or, at the Re where the force balances the weight (Archimedes number "
        f"{ARCHIMEDES:g}), sqrt(Cd² + Cl²): there the velocities of design and sphere are as their "
        f"Re. Bodies of least mean drag are drawn at {SHOWN:g} degrees.",
        draw=draw,
    )
}
