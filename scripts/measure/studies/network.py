"""How fast a surrogate predicts: drags per second, one at a time and in batches."""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
from study import Row, Run, Study, Table, columns
from tools import medians

from surrogate import load
from surrogate.training.samples import held_out_samples


def cases(run: Run) -> Iterator[Row]:
    """Drags and gradients; ``repeats`` calls are timed together."""
    batch, repeats = run.pick((100, 10), (10_000, 2000))
    for name in ("drag", "drag and shape gradient"):
        yield {"what": f"{name}, one at a time", "batch": 1, "repeats": repeats}
        yield {"what": f"{name}, {batch} at once", "batch": batch, "repeats": 1}
    yield {"what": f"drag, {batch} at once, float32", "batch": batch, "repeats": 1}


def measure(run, what, batch, repeats) -> Row:
    """Time compiled calls on arrays that are in place."""
    surrogate = load("pretrained")
    given = surrogate.network, held_out_samples(surrogate.scene, 0, batch)
    if "float32" in what:
        given = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), given)

    def drags(network, samples):
        call = jax.value_and_grad(network.drag) if "gradient" in what else network.drag
        if batch == 1:
            return call(samples.parameters[0], samples.reynolds[0])
        return jax.vmap(call)(*samples)

    compiled = jax.jit(drags).lower(*given).compile()

    def often():
        for _ in range(repeats):
            jax.block_until_ready(compiled(*given))

    seconds = medians([often], 15)[0] / repeats
    return {"per_second": batch / seconds, "call_us": 1e6 * seconds}


COLUMNS = "what {what} | per second {per_second:,.0f} | per call {call_us:.1f} us"
STUDY = Study([Table(cases, measure, columns(COLUMNS), tiny="all")])
