"""Half-inverse step, dense against matrix-free: time and memory from 1e3 to 1e6 weights.

python scripts/measure_hig.py --out out/hig
"""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
from common import Parser, emit, markdown, progress_bar, run

from surrogate.errors import InvalidInput
from surrogate.files import whole_file
from surrogate.model.network import make_network
from surrogate.scene.scene import FIDELITIES, Scene
from surrogate.training.methods.compliance import oseen_compliances
from surrogate.training.methods.hig import weight_step, with_goal_row
from surrogate.training.methods.method import predict
from surrogate.training.physics import draw_samples, prepare_physics, scene_domain

matplotlib.use("Agg")
import matplotlib.pyplot as plt

WEIGHTS = (1e3, 1e4, 1e5, 1e6)
TAU, KAPPA, GOAL, REPEATS = 1e-3, 0.5, 3.0, 3


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Build the real chain dy/da da/dw on networks of growing width, time both inverses."""
    arguments = _parser().parse_args(argv)
    if not (1 <= arguments.batch <= 512 and min(arguments.vectors) >= 1):
        raise InvalidInput("--batch: from 1 to 512; --vectors: from 1")
    scene = Scene(fidelity=FIDELITIES["draft"])
    samples = draw_samples(scene, jax.random.key(0), arguments.batch)
    physics = prepare_physics(scene_domain(scene), samples)
    rows = []
    with progress_bar("half inverses") as progress:
        for k, weights in enumerate(WEIGHTS):
            rows += _compare(scene, physics, weights, arguments.vectors, arguments.dense_gib)
            progress((k + 1) / len(WEIGHTS), f"{rows[-1]['weights']} weights")
    out = Path(arguments.out)
    _plot(rows, out / "hig.png")
    result = {"rows": rows, "batch": arguments.batch, "plot": str(out / "hig.png")}
    with whole_file(out / "hig.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, _text(rows))


def _compare(scene, physics, weights, counts, dense_gib) -> list[dict[str, Any]]:
    """Rows of one network: dense, then matrix-free with each number of Lanczos vectors.

    The slip is that of the untrained network; the dense form is not run where its arrays would
    take more than ``dense_gib``, but what it would take is told by the compiler all the same.
    """
    width = round(np.sqrt(weights + 121) - 11)
    oseen = np.asarray(physics.oseen.amplitude)
    network = make_network(
        scene, jax.random.key(1), np.asarray(physics.samples.reynolds), oseen, width
    )
    batch = jnp.arange(physics.count)
    matrix = oseen_compliances(physics).matrix
    miss = predict(network, physics, batch) - physics.oseen.amplitude
    slip = jnp.einsum("bym,bm->by", matrix, miss)
    y, physical = with_goal_row(slip, matrix, GOAL, oseen[:, 0])
    rows: list[dict[str, Any]] = []
    reference = None
    for vectors in (None, *counts):

        def step(network, y, physical, vectors=vectors):
            return weight_step(network, physics, batch, y, physical, TAU, KAPPA, vectors)

        compiled = jax.jit(step).lower(network, y, physical).compile()
        memory = compiled.memory_analysis()
        mib = (memory.temp_size_in_bytes + memory.output_size_in_bytes) / 2**20
        row = {"weights": int(network.weights.size), "rows": int(y.size), "vectors": vectors}
        seconds, difference = None, None
        if vectors is not None or mib < 1024 * dense_gib:
            answer, seconds = _timed(compiled, network, y, physical)
            reference = answer if vectors is None else reference
            if reference is not None:
                difference = float(jnp.linalg.norm(answer - reference) / jnp.linalg.norm(reference))
        rows.append(row | {"mib": mib, "seconds": seconds, "difference": difference})
    return rows


def _timed(function, *arguments):
    """The answer, and the least of a few times."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        answer = jax.block_until_ready(function(*arguments))
        times.append(time.perf_counter() - start)
    return answer, min(times)


def _name(vectors: int | None) -> str:
    return "dense" if vectors is None else f"{vectors} Lanczos vectors"


def _plot(rows: list[dict[str, Any]], path: Path) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for axis, key, label in zip(
        axes, ("seconds", "mib"), ("time of a step, s", "MiB"), strict=True
    ):
        for vectors in dict.fromkeys(row["vectors"] for row in rows):
            line = [r for r in rows if r["vectors"] == vectors and r[key] is not None]
            axis.plot(
                [r["weights"] for r in line], [r[key] for r in line], "o-", label=_name(vectors)
            )
        axis.set(xscale="log", yscale="log", xlabel="weights", ylabel=label)
        axis.legend(frameon=False)
    with whole_file(path) as part:
        figure.savefig(part, dpi=140)
    plt.close(figure)


def _text(rows: list[dict[str, Any]]) -> str:
    heads = ["weights", "rows", "inverse", "time", "memory", "differs from dense by"]
    lines = [
        [
            str(r["weights"]),
            str(r["rows"]),
            _name(r["vectors"]),
            "not run" if r["seconds"] is None else f"{r['seconds']:.3f} s",
            f"{r['mib']:.1f} MiB",
            "" if r["vectors"] is None or r["difference"] is None else f"{r['difference']:.1e}",
        ]
        for r in rows
    ]
    return markdown(heads, lines)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--batch", type=int, default=16, help="samples of a step")
    parser.add_argument("--vectors", type=int, nargs="+", default=[16, 64, 256])
    parser.add_argument("--dense-gib", type=float, default=6.0, help="run no larger dense inverse")
    parser.add_argument("--out", required=True, help="folder of hig.json and hig.png")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
