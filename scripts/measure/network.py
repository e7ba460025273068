"""How fast a surrogate answers: drags a second, one at a time and in batches.

python scripts/measure/network.py
"""

import sys
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from study import Result, Study, medians, run_study, table_of_rows

from surrogate import load
from surrogate.training.samples import held_out_samples


def measure(tiny: bool, progress: Callable) -> Result:
    """Time compiled calls on arrays that are in place."""
    surrogate, batch, alone = load("pretrained"), 100 if tiny else 10_000, 10 if tiny else 2000
    samples, rows = held_out_samples(surrogate.scene, 0, batch), []
    body, both = (samples.parameters[0], samples.reynolds[0]), jax.value_and_grad(surrogate.drag)
    for name, function in (("drag", surrogate.drag), ("drag and shape gradient", both)):
        progress(len(rows) / 5, name)
        rows.append(_row(f"{name}, one at a time", function, body, alone, 1))
        rows.append(_row(f"{name}, {batch} at once", jax.vmap(function), samples, 1, batch))
    narrow = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), (surrogate.network, samples))

    def drags(network, samples):
        return jax.vmap(network.drag)(*samples)

    rows.append(_row(f"drag, {batch} at once, float32", drags, narrow, 1, batch))
    return {"rows": rows}


def _row(what: str, function: Callable, arguments, calls: int, answers: int) -> dict[str, Any]:
    """Time of a call; ``calls`` of them are timed together."""
    compiled = jax.jit(function).lower(*arguments).compile()

    def often():
        for _ in range(calls):
            jax.block_until_ready(compiled(*arguments))

    seconds = medians([often], 15)[0] / calls
    return {"what": what, "per_second": answers / seconds, "call_us": 1e6 * seconds}


FORMS = "{what} | {per_second:,.0f} | {call_us:.1f} us"
STUDY = Study("network", measure, table_of_rows("what | a second | a call", FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
