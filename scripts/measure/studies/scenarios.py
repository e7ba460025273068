"""Cost of designs whose objective takes one flow, or many under uncertainty."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from figures import Line, Panel, draw_lines
from study import TINY, Result, Row, Run, Study, Table, columns, values

from shapeopt import Designer, LogNormal, Problem, Robust
from shapeopt.payoff.direct import design_directly
from surrogate import Flow, Scene, load

REYNOLDS = (4.0, 12.0)
DIRECT, GROWING, LED = "direct", "kriging from nothing", "network, and kriging"


def cases(run: Run) -> Iterator[Row]:
    """Numbers of uncertain cases, by three strategies."""
    for count in run.pick((1,), (1, 4, 32)):
        for way in run.pick((DIRECT, GROWING), (DIRECT, GROWING, LED)):
            yield {"cases": count, "way": way}


def measure(run: Run, cases: int, way: str) -> Row:
    """Robust designs, each to the flow's own optimum."""
    net = load("pretrained")
    scene = Scene(fidelity=TINY) if run.tiny else net.scene
    flow, found = Flow(scene), []
    for reynolds in run.pick(REYNOLDS[:1], REYNOLDS):
        spread = Robust(reynolds, LogNormal(0.2), 0.01, cases=cases) if cases > 1 else reynolds
        problem = Problem(scene, spread, max_length=1.7)
        if way == DIRECT:
            found.append(design_directly(problem, flow))
        else:
            found.append(Designer(net if way == LED else flow).design(problem))
    return {
        "flows": np.mean([design.flows for design in found]),
        "work": np.mean([design.green_applications for design in found]),
        "kkt": max(design.kkt_residual for design in found),
        "objectives": [design.objective for design in found],
    }


def draw(result: Result, path: Path) -> None:
    """Work per design against the number of cases."""
    rows = result["rows"]
    lines = [
        Line([(row["cases"], row["work"]) for row in rows if row["way"] == way], way)
        for way in values(rows, "way")
    ]
    draw_lines([Panel(lines, "flows per objective")], "convolutions with G per design", path)


COLUMNS = "cases {cases} | strategy {way} | flows per design {flows:.1f} | G per design {work:.0f}"
COLUMNS += " | largest KKT residual {kkt:.0e}"
STUDY = Study([Table(cases, measure, columns(COLUMNS), tiny="all")], draw=draw)
