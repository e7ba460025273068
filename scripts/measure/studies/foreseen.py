"""What flows, gradients and designs cost on average, from which costs are predicted."""

import time

import numpy as np
from study import TINY, Row, Run, Study, Table, columns

from shapeopt import optimise
from shapeopt.payoff.queries import query_stream
from surrogate import Family, Flow, Scene
from surrogate.flow.solver.steady import assembly_cost
from surrogate.scene.cost import APPLICATIONS, Applications, convolution_seconds
from surrogate.training.samples import held_out_samples

REPEATS = 5  # of a timed convolution
QUANTITIES = {
    "flow": "convolutions with G per flow, assembly included",
    "adjoint": "convolutions with G per shape gradient",
    "renewal": "convolutions with G to assemble a body again in a training",
    "design_flows": "flows with adjoints per design without a surrogate",
    "overhead": "seconds of a flow over those of its convolutions",
}


def measure(run: Run, dimension: int) -> list[Row]:
    """The averages over the default scene."""
    if run.tiny:
        small = Family(dimension=dimension, aspect=(1.0, 1.5))
        scenes = [Scene(family=small, fidelity=TINY)] * 2
    else:
        scenes = [Scene(dimension=dimension, fidelity=f) for f in ("standard", "draft")]
    found = _averages(*scenes, count=run.pick(1, 24))._asdict()
    return [{"name": name, "measured": found[name]} for name in QUANTITIES]


def _averages(scene: Scene, rough: Scene, count: int) -> Applications:
    """Of ``count`` random bodies, and of a sixth as many designs on a rough grid."""
    flow, bodies = Flow(scene), held_out_samples(scene, 0, count)
    flow.labels(*bodies)
    start = time.perf_counter()
    flows = flow.labels(*bodies).green_applications
    seconds = (time.perf_counter() - start) / np.sum(flows)
    both = flow.slopes(*bodies).green_applications
    shape = flow.domain.lattice.shape
    convolution = float(np.median([convolution_seconds(shape) for _ in range(REPEATS)]))
    queries = query_stream(rough, 0, max(count // 6, 1))
    designs = [optimise(problem, Flow(rough)) for problem in queries]
    return Applications(
        flow=float(np.mean(flows)),
        adjoint=float(np.mean(both) - np.mean(flows)),
        renewal=float(assembly_cost(flow.domain) if scene.dimension == 3 else 0),
        design_flows=float(np.mean([design.flows for design in designs])),
        overhead=seconds / convolution,
    )


def show(rows: list[Row]) -> str:
    form = "dimension {dimension} | average of {quantity} | measured {measured:.1f}"
    return columns(form)([row | {"quantity": QUANTITIES[row["name"]]} for row in rows])


STUDY = Study([Table(lambda run: [{"dimension": d} for d in APPLICATIONS], measure, show)])
