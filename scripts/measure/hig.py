"""HIG without ever forming its Jacobian, by Lanczos vectors: time and memory up to 1e6 weights.

python scripts/measure/hig.py
"""

import sys
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from study import TINY, Result, Study, medians, run_study, table_of_rows

from surrogate import FIDELITIES, Flow, Scene
from surrogate.devices import choose_devices
from surrogate.flow.loads import drag_coefficient
from surrogate.model.network import make_network
from surrogate.training.methods.hig import weight_step, with_goal_row
from surrogate.training.methods.labels import oseen_influence_matrices
from surrogate.training.methods.method import predict
from surrogate.training.physics import Physics, partition_samples, prepare_physics
from surrogate.training.samples import training_samples

TAU, KAPPA, GOAL = 1e-3, 0.5, 3.0


def measure(tiny: bool, progress: Callable) -> Result:
    """Build the real chain dy/da da/dw on networks of growing width, time both inverses."""
    flow = Flow(Scene(fidelity=TINY if tiny else FIDELITIES["draft"]))
    samples, rows = training_samples(flow.scene, 0, 4 if tiny else 16), []
    physics, _ = prepare_physics(
        flow, samples, partition_samples(flow.scene.family, samples, choose_devices())
    )
    sizes, counts = ((1e3,), (8,)) if tiny else ((1e3, 1e4, 1e5, 1e6), (16, 64, 256))
    for k, weights in enumerate(sizes):
        progress(k / len(sizes), f"{weights:g} weights")
        rows += _compare(physics, weights, counts)
    return {"batch": physics.count, "rows": rows}


def _compare(physics: Physics, weights: float, counts: tuple[int, ...]) -> Iterator[dict[str, Any]]:
    """Rows of one untrained network: dense, then matrix-free with so many Lanczos vectors."""
    oseen, key = np.asarray(physics.tractions), jax.random.key(1)
    width = round(np.sqrt(weights + 121) - 11)
    network = make_network(physics.flow.scene, key, *physics.samples, oseen, width)
    batch, matrix = jnp.arange(physics.count), oseen_influence_matrices(physics)
    slip = jnp.einsum("bym,bm->by", matrix, predict(network, physics.samples, batch) - oseen)
    y, physical = with_goal_row(slip, matrix, GOAL, drag_coefficient(oseen))
    dense = None
    for vectors in (None, *counts):

        def step(network, y, physical, vectors=vectors):
            def outcomes(weights, k):
                sample = jax.tree.map(lambda part: part[k], physics.samples)
                return physical[k] @ network.with_weights(weights).traction(*sample)

            return weight_step(outcomes, network.weights, batch, y, TAU, KAPPA, vectors)

        compiled = jax.jit(step).lower(network, y, physical).compile()
        memory = compiled.memory_analysis()
        answer = compiled(network, y, physical)
        dense = answer if vectors is None else dense
        yield {
            "weights": network.weights.size,
            "rows": y.size,
            "inverse": f"{vectors} Lanczos vectors" if vectors else "dense",
            "mib": (memory.temp_size_in_bytes + memory.output_size_in_bytes) / 2**20,
            "seconds": medians([lambda call=compiled: call(network, y, physical)], 3)[0],
            "difference": jnp.linalg.norm(answer - dense) / jnp.linalg.norm(dense),
        }


HEADS = "weights | rows | inverse | time | memory | differs from dense by"
FORMS = "{weights} | {rows} | {inverse} | {seconds:.3f} s | {mib:.1f} MiB | {difference:.1e}"
STUDY = Study("hig", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
