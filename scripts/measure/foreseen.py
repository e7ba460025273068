"""What flows, gradients and designs take in applications of G: what costs are foreseen by.

python scripts/measure/foreseen.py
"""

import sys
import time
from collections.abc import Callable

import numpy as np
from study import TINY, Result, Study, run_study, table_of_rows

from shapeopt import optimise
from shapeopt.payoff.queries import query_stream
from surrogate import Family, Flow, Scene
from surrogate.scene.cost import CONVOLUTIONS, Convolutions, convolution_seconds
from surrogate.training.samples import held_out_samples

REPEATS = 5  # times that a convolution is timed
HEADS = "dimension | applications of G, but for designs and overhead | measured"
FORMS = "{dimension} | {what} | {measured:.1f}"
WHAT = {
    "flow": "a flow, preparation included",
    "adjoint": "its shape gradient",
    "renewal": "preparing a body of a training anew",
    "design_flows": "a design by flows alone, in flows with their adjoints",
    "overhead": "a flow's seconds over those of its convolutions",
}


def measure(tiny: bool, progress: Callable) -> Result:
    """Both dimensions, each over its default scene."""
    rows = []
    for k, dimension in enumerate(CONVOLUTIONS):
        progress(k / len(CONVOLUTIONS), f"dimension {dimension}")
        if tiny:
            small = Family(dimension=dimension, aspect=(1.0, 1.5))
            scenes = [Scene(family=small, fidelity=TINY)] * 2
        else:
            scenes = [Scene(dimension=dimension, fidelity=f) for f in ("standard", "draft")]
        measured = _found(*scenes, count=1 if tiny else 24)._asdict()
        rows += [
            {"dimension": dimension, "name": name, "what": what, "measured": measured[name]}
            for name, what in WHAT.items()
        ]
    return {"rows": rows}


def _found(scene: Scene, rough: Scene, count: int) -> Convolutions:
    """Of so many bodies at random, and of a sixth of so many designs on a rough grid."""
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
    return Convolutions(
        flow=float(np.mean(flows)),
        adjoint=float(np.mean(both) - np.mean(flows)),
        renewal=float(flow.domain.assembly_cost if scene.dimension == 3 else 0),
        design_flows=float(np.mean([design.flows for design in designs])),
        overhead=seconds / convolution,
    )


STUDY = Study("foreseen", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
