"""Time and memory of the half-inverse step, dense and by Lanczos vectors, up to 1e6 weights."""

import jax
import jax.numpy as jnp
import numpy as np
from study import Row, Run, Study, Table, columns
from tools import medians, megabytes

from surrogate import Flow, Scene
from surrogate.devices import choose_devices
from surrogate.model.network import make_network
from surrogate.training.methods.hig import weight_step, with_goal_row
from surrogate.training.methods.method import predict
from surrogate.training.methods.targets import oseen_influence_matrices
from surrogate.training.physics import partition_samples, prepare_physics
from surrogate.training.samples import training_samples

TAU, KAPPA, GOAL = 1e-3, 0.5, 3.0


def measure(run: Run, size: float) -> list[Row]:
    """An untrained network's chain dy/da da/dw: dense, then matrix-free by Lanczos vectors."""
    flow = Flow(Scene(fidelity=run.fidelity("draft")))
    samples = training_samples(flow.scene, 0, run.pick(4, 16))
    physics, _ = prepare_physics(flow, samples, partition_samples(samples, choose_devices()))
    oseen, key = np.asarray(physics.tractions), jax.random.key(1)
    width = round(np.sqrt(size + 121) - 11)
    network = make_network(flow.scene, key, *physics.samples, oseen, width)
    batch, matrix = jnp.arange(physics.count), oseen_influence_matrices(physics)
    slip = jnp.einsum("bym,bm->by", matrix, predict(network, physics.samples, batch) - oseen)
    y, physical = with_goal_row(slip, matrix, GOAL, oseen[:, 0])
    rows, dense = [], None
    for vectors in (None, *run.pick((8,), (16, 64, 256))):

        def step(network, y, physical, vectors=vectors):
            def outcomes(weights, k):
                sample = jax.tree.map(lambda part: part[k], physics.samples)
                return physical[k] @ network.with_weights(weights)(*sample)

            return weight_step(outcomes, network.weights, batch, y, TAU, KAPPA, vectors)

        compiled = jax.jit(step).lower(network, y, physical).compile()
        found = compiled(network, y, physical)
        dense = found if vectors is None else dense
        rows.append(
            {
                "weights": network.weights.size,
                "rows": y.size,
                "inverse": f"{vectors} Lanczos vectors" if vectors else "dense",
                "mib": megabytes(compiled) * 1e6 / 2**20,
                "seconds": medians([lambda call=compiled: call(network, y, physical)], 3)[0],
                "difference": float(jnp.linalg.norm(found - dense) / jnp.linalg.norm(dense)),
            }
        )
    return rows


COLUMNS = "weights {weights} | rows {rows} | inverse {inverse} | time {seconds:.3f} s"
COLUMNS += " | memory {mib:.1f} MiB | difference from dense {difference:.1e}"
SIZES = [{"size": size} for size in (1e3, 1e4, 1e5, 1e6)]
STUDY = Study([Table(lambda run: SIZES, measure, columns(COLUMNS))])
