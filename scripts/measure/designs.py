"""How fast and by how many flows one designs: one at a time, a thousand in one call; a sheet.

python scripts/measure/designs.py
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from study import Result, Study, run_study, words

from shapeopt import Designer, optimise, optimise_all
from shapeopt.payoff.queries import query_stream
from shapeopt.render.designs import plot_designs
from shapeopt.search.sheet import designs_over
from surrogate import Flow, load

QUERIES, FEW, ROUNDS = 1000, 50, 3
REYNOLDS, LENGTHS = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0), (1.1, 1.3, 1.6, 2.0)


def measure(tiny: bool, progress: Callable) -> Result:
    """Times after compilation, the medians of rounds; every design of the call beside its own."""
    surrogate, count = load("pretrained"), 4 if tiny else QUERIES
    queries = query_stream(surrogate.scene, 0, count)
    alone, together = [], []
    for k in range(1 + ROUNDS):
        progress(k / (1 + ROUNDS), f"{count} queries")
        ours = [optimise(query, surrogate) for query in queries]
        alone.append([design.seconds for design in ours])
        begin = time.perf_counter()
        designs = optimise_all(queries, surrogate)
        together.append(time.perf_counter() - begin)
    few = queries[: 1 if tiny else FEW]
    fresh = {
        "nothing": [Designer(Flow(surrogate.scene)).design(query).flows for query in few],
        "the surrogate": [Designer(surrogate).design(query).flows for query in few],
    }
    gaps = [d.objective / one.objective - 1 for d, one in zip(designs, ours, strict=True)]
    return {
        "queries": count,
        "alone_s": np.median(alone[1:]),
        "together_s": np.median(together[1:]) / count,
        "first_s": together[0],
        "gap": np.max(np.abs(gaps)),
        "kkt": max(design.kkt_residual for design in designs),
        "calls": np.mean([design.calls for design in designs]),
        "fresh": fresh,
        "sheet": designs_over(surrogate, REYNOLDS, LENGTHS)[0],
    }


def tables(result: Result) -> str:
    """Two paragraphs."""
    form = (
        "The pretrained surrogate's own optimum takes {alone:.1f} ms a query one at a time, and "
        "{together:.1f} ms in a call of {queries} queries ({first:.0f} s with its compilation); "
        "each asks it for {calls:.0f} drags. The call's answers are those of the single route "
        "within {gap:.0e}, and their KKT residuals on the surrogate are at most {kkt:.0e}."
    )
    ms = {"alone": 1e3 * result["alone_s"], "together": 1e3 * result["together_s"]}
    flows = ", ".join(
        f"from {model} {np.mean(flows):.1f} on average and {max(flows)} at most"
        for model, flows in result["fresh"].items()
    )
    said = f"Flows that a design of the flow's own optimum takes with no memory: {flows}; "
    said += f"{len(result['fresh']['nothing'])} queries."
    return words(form, first=result["first_s"], **ms, **result) + f"\n\n{said}"


def draw(result: Result, path: Path) -> None:
    """The sheet of bodies."""
    plot_designs(load("pretrained").scene.family, result["sheet"], path)


STUDY = Study("designs", measure, tables, draw)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
