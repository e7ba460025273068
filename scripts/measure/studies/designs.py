"""Time and flows per design: one query at a time, many in one call; a sheet of designs."""

import time
from pathlib import Path

import numpy as np
from study import Result, Row, Run, Study, words

from shapeopt import Designer, optimise, optimise_all
from shapeopt.payoff.queries import query_stream
from shapeopt.render.designs import plot_designs
from shapeopt.search.sheet import designs_over
from surrogate import Flow, load

ROUNDS = 3
REYNOLDS, LENGTHS = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0), (1.1, 1.3, 1.6, 2.0)


def measure(run: Run, result: Result) -> Row:
    """Medians of rounds without compilation; designs of the call beside those one at a time."""
    surrogate, count = load("pretrained"), run.pick(4, 1000)
    queries = query_stream(surrogate.scene, 0, count)
    alone, together = [], []
    for k in range(1 + ROUNDS):
        run.progress(k / (2 + ROUNDS), f"{count} queries")
        ours = [optimise(query, surrogate) for query in queries]
        alone.append([design.seconds for design in ours])
        begin = time.perf_counter()
        designs = optimise_all(queries, surrogate)
        together.append(time.perf_counter() - begin)
    gaps = [d.objective / one.objective - 1 for d, one in zip(designs, ours, strict=True)]
    few, flow = queries[: run.pick(1, 50)], Flow(surrogate.scene)
    models = {"nothing": flow, "the surrogate": surrogate}
    return {
        "queries": count,
        "alone_s": np.median(alone[1:]),
        "together_s": np.median(together[1:]) / count,
        "first_s": together[0],
        "gap": np.max(np.abs(gaps)),
        "kkt": max(design.kkt_residual for design in designs),
        "calls": np.mean([design.calls for design in designs]),
        "fresh": {
            name: [Designer(model).design(query).flows for query in few]
            for name, model in models.items()
        },
        "sheet": designs_over(surrogate, REYNOLDS, LENGTHS)[0],
    }


def text(result: Result) -> str:
    """Two paragraphs."""
    form = (
        "The optimum of the pretrained surrogate takes {alone:.1f} ms per query one at a time, and "
        "{together:.1f} ms in a call of {queries} queries ({first_s:.0f} s with its compilation), "
        "with {calls:.0f} evaluations of the drag each. The objectives of the call differ from "
        "those found one at a time by {gap:.0e} at most; the largest KKT residual on the surrogate "
        "is {kkt:.0e}."
    )
    ms = {"alone": 1e3 * result["alone_s"], "together": 1e3 * result["together_s"]}
    flows = ", ".join(
        f"from {model} {np.mean(flows):.1f} on average and {max(flows)} at most"
        for model, flows in result["fresh"].items()
    )
    told = f"Flows per design of the flow's own optimum without a memory: {flows}; "
    told += f"{len(result['fresh']['nothing'])} queries."
    return f"{words(form, **ms, **result)}\n\n{told}"


def draw(result: Result, path: Path) -> None:
    """The sheet of bodies."""
    plot_designs(load("pretrained").scene.family, result["sheet"], path)


STUDY = Study([], text, extra=measure, draw=draw)
