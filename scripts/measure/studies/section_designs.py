"""Sections of least drag over a bound on the lift, at optima of the flow, and a polar; by chord.

Also the best glide ratio under uncertainty, and one section for several lifts. The polar is that of
the section with the best glide ratio, by the flow. With pictures: Cd over Cl with every body, the
polar, and streamlines at incidence.
"""

import dataclasses
from pathlib import Path

import numpy as np
from study import TINY, Result, Row, Run, Study, Table, columns, words

from shapeopt import Design, Designer, Glide, MultiPoint, Problem, Robust, optimise, optimise_all
from shapeopt.payoff.direct import design_directly
from shapeopt.render.over_lift import plot_over_lift
from shapeopt.render.polar import plot_polar
from shapeopt.search.over_lift import designs_over_lift
from surrogate import Flow, NotConverged, Scene, Solution, Surrogate, family_shape, load
from surrogate.flow.output.folder import flow_as_stored
from surrogate.flow.output.picture import draw_flows

NAME, REYNOLDS = "pretrained:lift", 40.0
LIFTS = tuple(np.linspace(0, 1.2, 7).tolist())
BEFORE = {"aspect": 2.0, "incidence": 10.0}  # the ellipse that is drawn first
ELLIPSE = {"aspect": (2.0, 2.2)} | dict.fromkeys(
    ("beta2", "beta3", "beta4", "gamma2", "gamma3"), (0.0, 0.0)
)  # the bodies of tiny runs
SPREAD, TOLERANCE, CASES = 0.2, 0.01, 8  # of the robust designs
INCIDENCES = tuple(range(-4, 13, 2))


def over_lift(run: Run) -> list[Row]:
    """Return the bodies of least drag over bounds on the lift, and that of best glide, last.

    They are optima of the flow, led by the network; ``network`` is the Cd of its own optimum.

    Raises:
      NotConverged: A body was not found.
    """
    net = load(NAME)
    reynolds, lifts = run.pick((6.0, LIFTS[:1]), (REYNOLDS, LIFTS))
    bounds = {"within": run.pick(ELLIPSE, None)}
    designer = Designer(run.pick(Flow(_scene(run, net)), net))
    rows, best, _ = designs_over_lift(designer, reynolds, lifts, run.progress, **bounds)
    if best["why_not"]:
        raise NotConverged(f"best glide: {best['why_not']}")
    problems = [Problem(net.scene, reynolds, lift=lift, **bounds) for lift in lifts]
    own = [design.drag for design in optimise_all(problems, net)]
    asked = [f"Cl at least {lift:.1f}" for lift in lifts]
    bodies = zip([*asked, "best glide"], [*rows, best], [*own, None], strict=True)
    return [row | {"asked": name, "network": cd} for name, row, cd in bodies]


def by_chord(run: Run, chord_reynolds: float, glide: bool, bounds: dict[str, float]) -> Row:
    """Return the best body of one chord, by the flow led by the network, and directly by SLSQP.

    ``by_thickness`` is the multiplier of the bound on t/c, ``network_error`` the objective that
    the network predicts at its own optimum over that of the flow's, minus 1, and ``beside`` by how
    much the direct optimum is worse than that, relative to it.
    """
    net = load(NAME)
    scene = _scene(run, net)
    bounds = run.pick(bounds | {"lift": 0.1}, bounds)  # what ellipses can reach
    limits = {"within": run.pick(ELLIPSE, None), **bounds, "by_chord": True}
    objective = Glide(chord_reynolds) if glide else chord_reynolds
    problem = Problem(scene, objective, **limits)
    found = Designer(run.pick(Flow(scene), net)).design(problem)
    own = optimise(Problem(net.scene, objective, **limits), net)
    return {
        "asked": "glide ratio" if glide else f"Cl {bounds['lift']:g}",
        "max_moment": bounds.get("max_moment"),
        "reynolds": found.reynolds,
        "parameters": scene.family.named(found.parameters),
        "cd": found.drag,
        "cl": found.lift,
        "cm": found.moment,
        "by_thickness": found.multipliers.get("min_thickness"),
        "network_flows": found.flows,
        "kkt_residual": found.kkt_residual,
        "network_error": own.objective / found.objective - 1,
        **_directly(problem, found),
    }


def _scene(run: Run, net: Surrogate) -> Scene:
    """Return the network's scene, on a coarse grid in tiny runs."""
    return dataclasses.replace(net.scene, fidelity=TINY) if run.tiny else net.scene


def _directly(problem: Problem, found: Design) -> Row:
    """Return the flows of SLSQP, and by how much its optimum is worse than one that was found.

    Both are None where it does not converge.
    """
    try:
        direct = design_directly(problem, Flow(problem.scene))
    except NotConverged:
        return {"direct_flows": None, "beside": None}
    worse = (direct.objective - found.objective) / abs(found.objective)
    return {"direct_flows": direct.flows, "beside": worse}


def robust(run: Run, level: float) -> Row:
    """Return the body of the best glide ratio under an uncertain Re and an inexact shape.

    It is an optimum of the flow, led by the network; ``nominal`` is its glide ratio at the nominal
    Re, without changes of shape.

    Args:
      run: How the study is run.
      level: CVaR level of the objective.
    """
    net = load(NAME)
    scene = _scene(run, net)
    cases, reynolds = run.pick((2, 8.0), (CASES, REYNOLDS))
    objective = Robust(reynolds, SPREAD, TOLERANCE, level, cases, glide=True)
    found = Designer(run.pick(Flow(scene), net)).design(Problem(scene, objective))
    return {
        "spread": SPREAD,
        "tolerance": TOLERANCE,
        "cases": cases,
        "parameters": scene.family.named(found.parameters),
        "nominal": found.lift / found.drag,
        "glide": -found.objective,
        "flows": found.flows,
        "kkt_residual": found.kkt_residual,
    }


def several(run: Run, reynolds: float, lifts: tuple[float, ...]) -> Row:
    """Return the section of least mean drag over several lifts, each at an incidence of its own.

    It is an optimum of the flow, led by the network; ``own`` is the mean of the least drags at
    these lifts of a section for each of them, and ``beside`` by how much the direct optimum, by
    SLSQP, is worse, relative to the objective.
    """
    net = load(NAME)
    scene = _scene(run, net)
    reynolds, lifts = run.pick((8.0, (0.05, 0.1)), (reynolds, lifts))
    bounds = {"within": run.pick(ELLIPSE, None)}
    problem = Problem(scene, MultiPoint(reynolds, lifts), **bounds)
    found = Designer(run.pick(Flow(scene), net)).design(problem)
    singles = [Problem(scene, reynolds, lift=lift, **bounds) for lift in lifts]
    own = [Designer(run.pick(Flow(scene), net)).design(one).drag for one in singles]
    cases = problem.scenarios.bodies(found.variables)
    return {
        "parameters": scene.family.named(found.parameters),
        "incidences": [scene.family.named(body)["incidence"] for body in cases],
        "cd": found.objective,
        "own": float(np.mean(own)),
        "flows": found.flows,
        "kkt_residual": found.kkt_residual,
        **_directly(problem, found),
    }


def polar(_: Run, result: Result) -> Result:
    """Return the loads of the section with the best glide ratio over the incidence, by the flow."""
    best, rows = result["rows"][-1], []
    for incidence in INCIDENCES:
        found = _solve(best["parameters"] | {"incidence": incidence}, best["reynolds"])
        at = {"incidence": incidence, "reynolds": best["reynolds"], "status": found.status}
        rows.append(at | {"cd": found.drag, "cl": found.lift, "cm": found.moment})
    return {"polar": rows}


def _solve(body: dict[str, float], reynolds: float) -> Solution:
    return Flow(Scene()).solve(family_shape(body), reynolds)


def in_short(result: Result) -> str:
    """Return the README's sentence on one section for several lifts."""
    rows = [row for row in result["several"] if row["direct_flows"] is not None]
    means = {n: np.mean([row[n] for row in rows]) for n in ("flows", "direct_flows")}
    form = "{n} sections for {count} lifts each: {flows:.3g} flows led by the network, "
    form += "{direct_flows:.3g} by `direct`."
    return words(form, count=len(rows[0]["lifts"]), n=len(rows), **means)


def text(result: Result) -> str:
    """Return sentences on the flows of all designs and on the network's predictions; the polar."""
    rows = result["rows"]
    total = sum(row["flows"] for row in rows)
    off = max(abs(row["network"] / row["cd"] - 1) for row in rows if row["network"] is not None)
    return (
        f"All {len(rows)} designs of the first table together take {total} flows. The least Cd "
        "that the network predicts differs from that of the flow's optimum by "
        f"{off:.2%} at most.\n\n"
        f"{POLAR(result['polar'])}"
    )


def draw(result: Result, path: Path) -> None:
    """Draw Cd over Cl with the bodies, the polar, and the flows of an ellipse and a section."""
    *rows, best = result["rows"]
    plot_over_lift(load(NAME).scene.family, rows, best, path)
    by_d = {"reference": "D", "chord_reynolds": None}
    polar = [row | by_d for row in result["polar"]]
    title = "the section with the best glide ratio, by the flow"
    plot_polar(polar, title, path.with_name(f"{path.stem}_polar.png"))
    pictures = []
    for name, body in (("ellipse", BEFORE), ("best glide ratio", best["parameters"])):
        found = _solve(body, best["reynolds"])
        title = f"{name}    Re {found.reynolds:g}    Cl/Cd {found.lift / found.drag:.3f}"
        pictures.append(flow_as_stored(found).picture._replace(title=title))
    draw_flows(pictures, path.with_name(f"{path.stem}_flows.png"))


def show_several(rows: list[Row]) -> str:
    """Return the table of the sections for several lifts."""
    lists = {"lifts": "g", "incidences": ".2f"}
    texts = [
        {n: ", ".join(f"{x:{form}}" for x in row[n]) for n, form in lists.items()} for row in rows
    ]
    return SEVERAL([row | text for row, text in zip(rows, texts, strict=True)])


FORM = columns(
    "asked {asked} | Cd {cd:.4f} | least Cd by the network {network:.4f} | Cl {cl:.4f}"
    " | Cm {cm:.4f} | Cl/Cd {glide:.4f} | incidence {parameters[incidence]:.2f}"
    " | flows {flows} | KKT residual {kkt_residual:.0e}"
)
POLAR = columns(
    "incidence {incidence:g} | Re {reynolds:g} | Cd {cd:.4f} | Cl {cl:z.4f} | Cm {cm:z.4f}"
    " | status {status}"
)
BY_CHORD = columns(
    "chord Re {chord_reynolds:g} | asked {asked} | Cm at most {max_moment:g} | Re {reynolds:.1f}"
    " | Cd / c {cd:.4f} | Cl / c {cl:.4f} | Cm / c^2 {cm:z.4f} | aspect {parameters[aspect]:.2f}"
    " | incidence {parameters[incidence]:.2f} | objective per t/c {by_thickness:+.2f}"
    " | flows {network_flows} | KKT residual {kkt_residual:.0e} | predicted {network_error:+.2%}"
    " | SLSQP: flows {direct_flows} | worse by {beside:+.2%}"
)
ROBUST = columns(
    "CVaR level {level:g} | spread of log Re {spread:g} | tolerance of the shape {tolerance:g}"
    " | cases {cases} | Cl/Cd of them {glide:.4f} | at the nominal Re {nominal:.4f}"
    " | incidence {parameters[incidence]:.2f} | flows {flows} | KKT residual {kkt_residual:.0e}"
)
THICK = {"min_thickness": 0.3}  # over the chord
CHORDS = [
    {"chord_reynolds": re, "glide": glide, "bounds": THICK | bounds}
    for re in (30.0, 100.0, 200.0)
    for glide, bounds in ((False, {"lift": 0.3}), (True, {"max_moment": 0.1}))
]
SEVERAL = columns(
    "Re {reynolds:g} | lifts {lifts} | incidences {incidences} | aspect {parameters[aspect]:.2f}"
    " | gamma2 {parameters[gamma2]:z.3f} | mean Cd {cd:.4f}"
    " | of a section for each lift {own:.4f} | flows {flows} | KKT residual {kkt_residual:.0e}"
    " | SLSQP: flows {direct_flows} | worse by {beside:+.2%}"
)
POINTS = [
    {"reynolds": 40.0, "lifts": (0.2, 0.6, 1.0)},
    {"reynolds": 100.0, "lifts": (0.2, 0.5, 0.8)},
]
LEVELS = [{"level": 0.0}, {"level": 0.8}]
TABLES = [
    Table([{}], over_lift, FORM),
    Table(CHORDS, by_chord, BY_CHORD, "by_chord"),
    Table(LEVELS, robust, ROBUST, "robust"),
    Table(POINTS, several, show_several, "several"),
]
STUDIES = {"section_designs": Study(TABLES, text, polar, draw)}
