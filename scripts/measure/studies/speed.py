"""How fast the 2-D flow is: over cells, with gradients, in batches, against finite elements."""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from elements import PLANE, solve_by_elements
from meshes import Elements
from studies.flow import REFERENCES
from study import TINY, Result, Row, Run, Study, Table, columns, words
from tools import drag_cost, medians, power_of

from surrogate import Family, Fidelity, Flow, Scene
from surrogate.training.samples import held_out_samples

REYNOLDS = (1.0, 10.0, 40.0)
ROUND = Family(aspect=(1.0, 1.2))  # its grid is made for little more than the cylinder
TINY_MESH = Elements(order=2, wall=0.2, near=0.5)


def grids(run: Run) -> list[Row]:
    return [{"n": n} for n in (8, 16, 32, 64, 118)]


def cells(run: Run, n: int) -> Row:
    """The cylinder at Re 10: seconds and memory of a drag."""
    fidelity = run.pick(TINY, Fidelity("", n, 6, 12, 8))
    return drag_cost(Scene(family=ROUND, fidelity=fidelity), [1.0], 10.0, run.pick(1, 7))


def numbers(run: Run) -> list[Row]:
    return [{"reynolds": reynolds} for reynolds in REYNOLDS]


def gradients(run: Run, reynolds: float) -> Row:
    """What a gradient of the ellipse of aspect 2 adds to a drag, in drags."""
    flow = Flow(Scene(fidelity=run.fidelity("standard")))
    query = jnp.asarray(flow.scene.family.ellipse(2.0)), jnp.asarray(reynolds)
    calls = jax.jit(flow.drag), flow.slope, jax.jit(jax.value_and_grad(flow.drag, argnums=(0, 1)))
    drag, shape, both = medians([lambda f=f: f(*query) for f in calls], run.pick(1, 7))
    row = {"ms": 1e3 * drag, "shape_gradient": shape / drag - 1}
    return row | {"gradient_with_reynolds": both / drag - 1}


def sizes(run: Run) -> Iterator[Row]:
    for name in ("draft", "standard"):
        for batch in (1, 4, 16):
            yield {"fidelity": run.fidelity(name), "batch": batch}


def batches(run: Run, fidelity: Fidelity, batch: int) -> Row:
    """Flows per second of random bodies, each at its own Re: one after another, and vmapped."""
    flow = Flow(Scene(fidelity=fidelity))
    samples, calls = held_out_samples(flow.scene, 0, batch), (flow.labels, jax.vmap(flow.drag))
    calls = calls[0], jax.jit(calls[1])
    turns, steps = medians([lambda f=f: f(*samples) for f in calls], run.pick(1, 7))
    return {"in_turn": batch / turns, "vmapped": batch / steps}


def rival(run: Run, reynolds: float) -> Row:
    """The cylinder by the flow and by finite elements, which take turns."""
    drag = jax.jit(Flow(Scene(family=ROUND, fidelity=run.fidelity("standard"))).drag)
    query, seconds, others = (jnp.array([1.0]), jnp.asarray(reynolds)), [], []
    for _ in range(run.pick(1, 4)):
        mesh = run.pick(TINY_MESH, None)
        others.append(solve_by_elements(PLANE, {"aspect": 1.0}, reynolds, mesh))
        seconds += medians([lambda: drag(*query)], run.pick(2, 14))
    exact, ours = REFERENCES["unbounded"][reynolds], float(np.median(seconds))
    theirs = float(np.median([other.seconds for other in others]))
    row = {"error": float(drag(*query)) / exact - 1, "ms": 1e3 * ours}
    row |= {"rival_error": others[0].cd / exact - 1, "rival_s": theirs}
    return row | {"rival_unknowns": others[0].unknowns, "faster": theirs / ours}


def text(result: Result) -> str:
    return words("Time grows as cells to the power {power:.2f}.", **result)


def power(run: Run, result: Result) -> Row:
    return {"power": power_of(result["cells"], "cells", "seconds")}


CELLS = "cells per D {n} | cells {cells} | time {seconds:.3f} s | memory {megabytes:.0f} MB"
GRADIENTS = "Re {reynolds:g} | a drag {ms:.0f} ms | shape gradient, in drags {shape_gradient:+.2f}"
GRADIENTS += " | gradient with Re, in drags {gradient_with_reynolds:+.2f}"
BATCHES = "fidelity {fidelity} | batch {batch} | flows per s, one by one {in_turn:.1f}"
BATCHES += " | vmapped {vmapped:.1f}"
RIVAL = "Re {reynolds:g} | flow {ms:.0f} ms | error {error:+.2%} | finite elements {rival_s:.2f} s"
RIVAL += " | error {rival_error:+.2%} | speedup of the flow {faster:.0f}"
TABLES = [
    Table(grids, cells, columns(CELLS), "cells"),
    Table(numbers, gradients, columns(GRADIENTS), "gradients"),
    Table(sizes, batches, columns(BATCHES), "batches"),
    Table(numbers, rival, columns(RIVAL), "rival"),
]
STUDY = Study(TABLES, text, extra=power)
