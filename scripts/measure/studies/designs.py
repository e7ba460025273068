"""Cost of designs: one at a time, many in one call, under uncertainty; and predicted costs."""

import dataclasses
import time
from pathlib import Path

import numpy as np
from figures import lines
from study import TINY, Result, Row, Run, Study, Table, cases, columns, words

from shapeopt import Designer, LogNormal, Problem, Robust, optimise, optimise_all
from shapeopt.payoff.direct import design_directly
from shapeopt.payoff.queries import query_stream
from shapeopt.render.designs import plot_designs
from shapeopt.search.sheet import designs_over
from surrogate import Family, Flow, Scene, load
from surrogate.scene.cost import Convolutions, convolution_seconds
from surrogate.scene.fidelity import NAMED
from surrogate.scene.samples import held_out_samples

ROUNDS = 3
NUMBERS, LENGTHS = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0), (1.1, 1.3, 1.6, 2.0)  # of the sheet
REYNOLDS = (4.0, 12.0)  # of robust designs
DIRECT, GROWING, LED = "direct", "kriging from nothing", "network, and kriging"
REPEATS = 5  # of a timed convolution
SYMMETRIC, LIFTING = "symmetric", "at incidence"
SCENES = {2: "lift.toml", 3: "particle.toml"}  # with lift, in the folder of the scripts
QUANTITIES = {
    "flow": "convolutions with G per flow, assembly included",
    "adjoint": "convolutions with G for the gradients of all loads",
    "renewal": "convolutions with G to assemble a body again in a training",
    "design_flows": "flows with adjoints per design without a surrogate",
    "overhead": "seconds of a flow over those of its convolutions",
}


def many_designs(run: Run, _: Result) -> Result:
    """Return seconds per design, one at a time and in one call, and how the two compare."""
    surrogate, count = load("pretrained"), run.pick(4, 1000)
    queries, alone, together = query_stream(surrogate.scene, 0, count), [], []
    for k in range(1 + ROUNDS):
        run.progress(k / (2 + ROUNDS), f"{count} queries")
        ours = [optimise(query, surrogate) for query in queries]
        alone.append(sum(design.seconds for design in ours))
        begin = time.perf_counter()
        designs = optimise_all(queries, surrogate)
        together.append(time.perf_counter() - begin)
    gaps = [d.objective / one.objective - 1 for d, one in zip(designs, ours, strict=True)]
    few = queries[: run.pick(1, 50)]
    models = {"nothing": Flow(surrogate.scene), "the surrogate": surrogate}
    fresh = {
        name: [Designer(model).design(query).flows for query in few]
        for name, model in models.items()
    }
    return {
        "queries": count,
        "alone_s": np.median(alone[1:]) / count,
        "together_s": np.median(together[1:]) / count,
        "first_s": together[0],
        "gap": np.max(np.abs(gaps)),
        "kkt": max(design.kkt_residual for design in designs),
        "calls": np.mean([design.calls for design in designs]),
        "fresh": fresh,
        "sheet": designs_over(surrogate, NUMBERS, LENGTHS)[0],
    }


def many_text(result: Result) -> str:
    """Return the result of ``many_designs`` as two paragraphs."""
    form = (
        "The optimum of the pretrained surrogate takes {alone:.1f} ms per query one at a time, and "
        "{together:.1f} ms in a call of {queries} queries ({first_s:.0f} s with its compilation), "
        "with {calls:.0f} evaluations of the drag each. The objectives of the call differ from "
        "those found one at a time by {gap:.0e} at most; the largest KKT residual on the surrogate "
        "is {kkt:.0e}.\n\nFlows per design of the flow's own optimum without a memory: {flows}; "
        "{few} queries."
    )
    flows = ", ".join(
        f"from {model} {np.mean(flows):.1f} on average and {max(flows)} at most"
        for model, flows in result["fresh"].items()
    )
    ms = {"alone": 1e3 * result["alone_s"], "together": 1e3 * result["together_s"]}
    return words(form, flows=flows, few=len(result["fresh"]["nothing"]), **ms, **result)


def draw_sheet(result: Result, path: Path) -> None:
    """Draw the designs over Re and length."""
    plot_designs(load("pretrained").scene.family, result["sheet"], path)


def robust(run: Run, cases: int, strategy: str) -> Row:
    """Return the cost of designs whose objective takes one flow, or many.

    Each is the flow's own optimum; ``strategy`` is its name.
    """
    net = load("pretrained")
    scene = Scene(fidelity=TINY) if run.tiny else net.scene
    flow, found = Flow(scene), []
    for reynolds in run.pick(REYNOLDS[:1], REYNOLDS):
        spread = Robust(reynolds, LogNormal(0.2), 0.01, cases=cases) if cases > 1 else reynolds
        problem = Problem(scene, spread, max_length=1.7)
        if strategy == DIRECT:
            found.append(design_directly(problem, flow))
        else:
            found.append(Designer(net if strategy == LED else flow).design(problem))
    return {
        "flows": np.mean([design.flows for design in found]),
        "work": np.mean([design.green_applications for design in found]),
        "kkt": max(design.kkt_residual for design in found),
        "objectives": [design.objective for design in found],
    }


def averages(run: Run, dimension: int, bodies: str) -> list[Row]:
    """Return the mean costs over a scene, from which costs are predicted."""
    if run.tiny:
        small = Family(dimension=dimension, aspect=(1.0, 1.5))
        scene = rough = Scene(family=small, fidelity=TINY)
    else:
        scene = Scene(dimension=dimension)
        if bodies == LIFTING:
            scene = Scene.read(Path(__file__).parents[2] / SCENES[dimension])
        coarse = dataclasses.replace(scene.fidelity, cells=NAMED[dimension]["draft"].cells)
        rough = dataclasses.replace(scene, fidelity=coarse)
    many = {2: 24, 3: 12 if bodies == SYMMETRIC else 6}[dimension]
    found = _averages(scene, rough, run.pick(1, many))._asdict()
    return [{"name": name, "measured": found[name]} for name in QUANTITIES]


def _averages(scene: Scene, rough: Scene, count: int) -> Convolutions:
    """Return the means over random bodies, and over a third as many designs on a rough grid."""
    flow, bodies = Flow(scene), held_out_samples(scene, 0, count)
    flow.solve_all(*bodies, allow_unsteady=True)
    start = time.perf_counter()
    flows = flow.solve_all(*bodies, allow_unsteady=True).green_applications
    seconds = (time.perf_counter() - start) / np.sum(flows)
    both = flow.solve_all(*bodies, gradients=True, allow_unsteady=True).green_applications
    shape = flow.domain.lattice.shape
    convolution = float(np.median([convolution_seconds(shape) for _ in range(REPEATS)]))
    queries = query_stream(rough, 0, max(count // 3, 1))
    designs = [optimise(problem, Flow(rough)) for problem in queries]
    return Convolutions(
        flow=float(np.mean(flows)),
        adjoint=float(np.mean(both) - np.mean(flows)),
        renewal=0.0 if flow.domain.operators_are_small else float(flow.domain.assembly_cost),
        design_flows=float(np.mean([design.flows for design in designs])),
        overhead=seconds / convolution,
    )


def show_averages(rows: list[Row]) -> str:
    """Return the table of mean costs, with the quantities in words."""
    form = "dimension {dimension} | bodies {bodies} | average {quantity} | measured {measured:.1f}"
    return columns(form)([row | {"quantity": QUANTITIES[row["name"]]} for row in rows])


ROBUST = columns(
    "cases {cases} | strategy {strategy} | flows per design {flows:.1f} | G per design {work:.0f}"
    " | largest KKT residual {kkt:.0e}"
)
COUNTS = cases(cases=(1, 4, 32), strategy=(GROWING, DIRECT, LED))
WORK = lines("cases", "work", "strategy", ("flows per objective", "convolutions with G per design"))
STUDIES = {
    "designs": Study([], many_text, many_designs, draw_sheet),
    "scenarios": Study([Table(COUNTS, robust, ROBUST)], draw=WORK),
    "foreseen": Study(
        [Table(cases(dimension=(2, 3), bodies=(SYMMETRIC, LIFTING)), averages, show_averages)]
    ),
}
