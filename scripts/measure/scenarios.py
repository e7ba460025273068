"""What a design costs that asks for many drags: one Reynolds number, several, 32 uncertain cases.

python scripts/measure/scenarios.py
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from study import TINY, Result, Study, run_study, table_of_rows

from shapeopt import Designer, LogNormal, Problem, Robust
from shapeopt.payoff.direct import design_directly
from shapeopt.render.figures import STYLE, plt, save_figure
from surrogate import Flow, Scene, load

CASES = (1, 4, 32)
REYNOLDS = (4.0, 12.0)


def measure(tiny: bool, progress: Callable) -> Result:
    """Robust designs over more and more cases, by every way, each to the flow's own optimum."""
    net = load("pretrained")
    scene = Scene(fidelity=TINY) if tiny else net.scene
    flow, rows = Flow(scene), []
    ways: dict[str, Callable[[Problem], Any]] = {
        "direct": lambda problem: design_directly(problem, flow),
        "kriging from nothing": lambda problem: Designer(flow).design(problem),
    }
    if not tiny:
        ways["network, and kriging"] = lambda problem: Designer(net).design(problem)
    for k, cases in enumerate(CASES[:1] if tiny else CASES):
        for name, design in ways.items():
            progress(k / len(CASES), f"{cases} cases, {name}")
            found = []
            for reynolds in REYNOLDS[:1] if tiny else REYNOLDS:
                spread = LogNormal(0.2)
                robust = Robust(reynolds, spread, 0.01, cases=cases) if cases > 1 else reynolds
                found.append(design(Problem(scene, robust, max_length=1.7)))
            rows.append(
                {
                    "cases": cases,
                    "way": name,
                    "flows": np.mean([design.flows for design in found]),
                    "work": np.mean([design.green_applications for design in found]),
                    "kkt": max(design.kkt_residual for design in found),
                    "objectives": [design.objective for design in found],
                }
            )
    return {"rows": rows}


def draw(result: Result, path: Path) -> None:
    """Applications of G a design against the cases that it asks for."""
    with plt.rc_context(STYLE):
        figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    for way in dict.fromkeys(row["way"] for row in result["rows"]):
        points = [(r["cases"], r["work"]) for r in result["rows"] if r["way"] == way]
        axis.loglog(*zip(*points, strict=True), "o-", ms=3, label=way)
    axis.set(xlabel="drags an objective asks for", ylabel="applications of G a design")
    axis.legend(frameon=False)
    save_figure(figure, path)


HEADS = "cases | way | flows a design | G a design | KKT at most"
FORMS = "{cases} | {way} | {flows:.1f} | {work:.0f} | {kkt:.0e}"
STUDY = Study("scenarios", measure, table_of_rows(HEADS, FORMS), draw)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
