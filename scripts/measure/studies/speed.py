"""Speed of 2-D flows and of surrogates: over cells, with gradients, in batches, and of elements."""

import functools
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from elements import (
    PLANE,
    solve_by_elements,
)
from meshes import Elements
from studies.accuracy import REFERENCES
from study import TINY, Row, Run, Study, Table, cases, columns
from tools import alone, medians, megabytes, power_of

from surrogate import Family, Fidelity, Flow, Scene, load
from surrogate.scene.samples import held_out_samples

REYNOLDS = (1.0, 10.0, 40.0)
RE = 10.0  # of the grids, and of the flattened body
ROUND = {  # families of little more than the circle, and than the spheroid of aspect 2
    2: Family(aspect=(1.0, 1.2)),
    3: Family(dimension=3, aspect=(1.0, 2.0)),
}


def query_of(body: float, reynolds: float) -> tuple[jax.Array, jax.Array]:
    """Return the arguments of a drag: a body of one parameter, and Re."""
    return jnp.array([body]), jnp.asarray(reynolds)


def drag_cost(scene: Scene, repeats: int) -> Row:
    """Return the cells of a scene's grid, and seconds and memory of the drag of a round body."""
    flow, query = Flow(scene), query_of(1.0, RE)
    compiled = jax.jit(flow.drag).lower(*query).compile()
    seconds = medians([lambda: compiled(*query)], repeats)[0]
    cells = int(np.prod(flow.domain.lattice.shape))
    return {"cells": cells, "seconds": seconds, "megabytes": megabytes(compiled)}


def cells(run: Run, n: int) -> Row:
    """Return the cost of the drag of the cylinder on a grid of ``n`` cells per D."""
    fidelity = run.pick(TINY, Fidelity("", n, 6, 12, 8))
    return drag_cost(Scene(family=ROUND[2], fidelity=fidelity), run.pick(1, 7))


def gradients(run: Run, reynolds: float) -> Row:
    """Return milliseconds of the drag of the ellipse of aspect 2, and of the drag with gradients.

    Each is taken as if alone, and with the operators of the stream kept from a flow at the same Re.
    """
    flow = Flow(Scene(fidelity=run.fidelity("standard")))
    query = jnp.asarray(flow.scene.family.ellipse(2.0)), jnp.asarray(reynolds)
    calls = {
        "drag": flow.drag,
        "designs": flow.loads_and_gradients,
        "body": jax.value_and_grad(flow.drag),
        "reynolds_grad": jax.value_and_grad(flow.drag, argnums=(0, 1)),
    }
    row = {}
    for name, call in calls.items():
        kept = functools.partial(call, *query)
        alone_s, kept_s = medians([functools.partial(alone, kept), kept], run.pick(1, 7))
        row |= {name: 1e3 * alone_s, f"{name}_kept": 1e3 * kept_s}
    return row


def batches(run: Run, fidelity: str, batch: int) -> Row:
    """Return flows per second of random bodies, each at its own Re: one by one, and vmapped."""
    flow = Flow(Scene(fidelity=run.fidelity(fidelity)))
    samples, vmapped = held_out_samples(flow.scene, 0, batch), jax.jit(jax.vmap(flow.drag))
    calls = [lambda f=f: f(*samples) for f in (flow.solve_all, vmapped)]
    turns, steps = medians(calls, run.pick(1, 7))
    return {"in_turn": batch / turns, "vmapped": batch / steps}


def rival(run: Run, reynolds: float) -> Row:
    """Compare the cylinder by the flow with that by finite elements, which take turns."""
    drag = jax.jit(Flow(Scene(family=ROUND[2], fidelity=run.fidelity("standard"))).drag)
    query, seconds, others = query_of(1.0, reynolds), [], []
    mesh = run.pick(Elements(order=2, wall=0.2, near=0.5), None)
    for _ in range(run.pick(1, 4)):
        others.append(solve_by_elements(PLANE, {"aspect": 1.0}, reynolds, mesh))
        seconds += medians([lambda: drag(*query)], run.pick(2, 14))
    exact, ours = REFERENCES["unbounded"][reynolds], float(np.median(seconds))
    theirs = float(np.median([other.seconds for other in others]))
    row = {"error": float(drag(*query)) / exact - 1, "ms": 1e3 * ours}
    row |= {"rival_error": others[0].cd / exact - 1, "rival_s": theirs}
    return row | {"rival_unknowns": others[0].unknowns, "faster": theirs / ours}


def answers(run: Run) -> Iterator[Row]:
    """Yield the cases: drags and gradients of a surrogate; ``repeats`` calls are timed together."""
    batch, repeats = run.pick((100, 10), (10_000, 2000))
    for name in ("drag", "drag and shape gradient"):
        yield {"what": f"{name}, one at a time", "batch": 1, "repeats": repeats}
        yield {"what": f"{name}, {batch} at once", "batch": batch, "repeats": 1}
    yield {"what": f"drag, {batch} at once, float32", "batch": batch, "repeats": 1}


def surrogate(run: Run, what: str, batch: int, repeats: int) -> Row:
    """Time compiled calls of a surrogate on arrays that are in place.

    Args:
      run: How the study is run.
      what: Is evaluated, in words.
      batch: Number of bodies at once.
      repeats: Calls that are timed together.
    """
    model = load("pretrained")
    given = jax.tree.map(jnp.asarray, (model.network, held_out_samples(model.scene, 0, batch)))
    if "float32" in what:
        given = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), given)

    def drags(network, samples):
        call = jax.value_and_grad(network.drag) if "gradient" in what else network.drag
        if batch == 1:
            return call(samples.parameters[0], samples.reynolds[0])
        return jax.vmap(call)(*samples)

    compiled = jax.jit(drags).lower(*given).compile()
    many = medians([lambda: [jax.block_until_ready(compiled(*given)) for _ in range(repeats)]], 15)
    return {"per_second": batch * repeats / many[0], "call_us": 1e6 * many[0] / repeats}


TIME = "time {seconds:.2f} s | memory {megabytes:.0f} MB"
CELLS = columns("cells per D {n} | cells {cells} | " + TIME.replace(".2f", ".3f"))
GRADIENTS = columns(
    "Re {reynolds:g} | drag {drag:.0f} ms, {drag_kept:.0f} ms"
    " | with gradient as in designs {designs:.0f} ms, {designs_kept:.0f} ms"
    " | with jax.grad by the body {body:.0f} ms, {body_kept:.0f} ms"
    " | by body and Re {reynolds_grad:.0f} ms, {reynolds_grad_kept:.0f} ms"
)
BATCHES = columns(
    "fidelity {fidelity} | batch {batch} | flows per s, one by one {in_turn:.1f}"
    " | vmapped {vmapped:.1f}"
)
RIVAL = columns(
    "Re {reynolds:g} | flow {ms:.0f} ms | error {error:+.2%} | finite elements {rival_s:.2f} s"
    " | error {rival_error:+.2%} | speedup of the flow {faster:.0f}"
)
CALLS = columns("what {what} | per second {per_second:,.0f} | per call {call_us:.1f} us")
PAIR = ("draft", "standard")
STUDIES = {
    "speed": Study(
        [
            Table(cases(n=(8, 16, 32, 64, 118)), cells, CELLS, "cells"),
            Table(cases(reynolds=REYNOLDS), gradients, GRADIENTS, "gradients"),
            Table(cases(fidelity=PAIR, batch=(1, 4, 16)), batches, BATCHES, "batches"),
            Table(cases(reynolds=REYNOLDS), rival, RIVAL, "rival"),
        ],
        "Time grows as cells to the power {power:.2f}.",
        lambda run, result: {"power": power_of(result["cells"], "cells", "seconds")},
    ),
    "network": Study([Table(answers, surrogate, CALLS, tiny="all")]),
}
