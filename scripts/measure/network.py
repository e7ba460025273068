"""How fast a surrogate answers: drags a second, one at a time and in batches.

python scripts/measure_network.py --surrogate pretrained
"""

import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from common import Parser, emit, markdown, progress_bar, run

from surrogate.errors import InvalidInput
from surrogate.model.store import Surrogate, load_surrogate
from surrogate.training.physics import draw_samples

ALONE, REPEATS = 2000, 20


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Time compiled calls on arrays that are in place; compilation is left out."""
    arguments = _parser().parse_args(argv)
    if not 1 <= arguments.batch <= 10**6:
        raise InvalidInput(f"--batch {arguments.batch}: from 1 to 1000000")
    surrogate = load_surrogate(arguments.surrogate)
    with progress_bar("speed") as progress:
        rows = _measure(surrogate, arguments.batch)
        progress(1.0)
    result = {"rows": rows, "batch": arguments.batch, "surrogate": arguments.surrogate}
    return emit(result, arguments.json, _text(rows))


def _measure(surrogate: Surrogate, batch: int) -> list[dict[str, Any]]:
    """Best of a few rounds: other work on the machine only ever slows one down."""
    samples = draw_samples(surrogate.scene, jax.random.key(0), batch)
    body, reynolds = samples.parameters[0], samples.reynolds[0]
    drag, slope = surrogate.drag, jax.grad(surrogate.drag)
    rows = []
    for name, function in (("drag", drag), ("drag and shape gradient", _both(drag, slope))):
        single = jax.jit(function).lower(body, reynolds).compile()
        many = jax.jit(jax.vmap(function)).lower(*samples).compile()
        rows.append({"what": f"{name}, one at a time"} | _rate(single, (body, reynolds), ALONE, 1))
        rows.append({"what": f"{name}, {batch} at once"} | _rate(many, samples, 1, batch))
        narrow = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), (surrogate.network, samples))
        if name == "drag":
            many = jax.jit(_drags).lower(*narrow).compile()
            label = f"{name}, {batch} at once, float32"
            rows.append({"what": label} | _rate(many, narrow, 1, batch))
    return rows


def _drags(network, samples):
    return jax.vmap(network.drag)(*samples)


def _both(drag: Callable, slope: Callable) -> Callable:
    return lambda body, reynolds: (drag(body, reynolds), slope(body, reynolds))


def _rate(function, arguments, calls: int, answers: int) -> dict[str, float]:
    jax.block_until_ready(function(*arguments))
    best = float("inf")
    for _ in range(REPEATS):
        start = time.perf_counter()
        for _ in range(calls):
            jax.block_until_ready(function(*arguments))
        best = min(best, (time.perf_counter() - start) / calls)
    return {"per_second": answers / best, "call_us": 1e6 * best}


def _text(rows: list[dict[str, Any]]) -> str:
    lines = [[r["what"], f"{r['per_second']:,.0f}", f"{r['call_us']:.1f} us"] for r in rows]
    return markdown(["what", "a second", "a call"], lines)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--surrogate", default="pretrained", help="a folder, or pretrained")
    parser.add_argument("--batch", type=int, default=10_000, help="bodies at once")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
