"""How fast the flow is: against cells, with gradients, in batches, against finite elements.

python scripts/measure/speed.py

The rival needs NGSolve: pip install -e '.[bench]'.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from elements import Elements
from flow import REFERENCES
from plane import ELEMENTS, solve_by_plane_elements
from study import TINY, Result, Study, medians, megabytes, power_of, run_study, table, words

from surrogate import FIDELITIES, Family, Fidelity, Flow, InvalidInput, Scene
from surrogate.training.samples import held_out_samples

CELLS = (8, 16, 32, 64, 118)
BATCHES = (1, 4, 16)
REYNOLDS = (1.0, 10.0, 40.0)
ROUND = Family(aspect=(1.0, 1.2))  # its grid is made for little more than the cylinder
Rows = Iterator[dict[str, Any]]

TABLES = {  # heads and formats
    "cells": (
        "cells per D | cells | time | memory",
        "{n} | {cells} | {seconds:.3f} s | {megabytes:.0f} MB",
    ),
    "gradients": (
        "Re | a drag | shape gradient, in drags | gradient with Re, in drags",
        "{reynolds:g} | {ms:.0f} ms | {shape_gradient:+.2f} | {gradient_with_reynolds:+.2f}",
    ),
    "batches": (
        "fidelity | batch | flows per s in turn | vmapped",
        "{fidelity} | {batch} | {in_turn:.1f} | {vmapped:.1f}",
    ),
    "rival": (
        "Re | ours | off by | finite elements | off by | times faster",
        "{reynolds:g} | {ms:.0f} ms | {error:+.2%} | {rival_s:.2f} s | {rival_error:+.2%}"
        " | {faster:.0f}",
    ),
}


def measure(tiny: bool, progress: Callable) -> Result:
    """Four tables."""
    standard = TINY if tiny else FIDELITIES["standard"]
    levels = [TINY] if tiny else [FIDELITIES["draft"], standard]
    grids = [TINY] if tiny else [Fidelity("", n, 6, 12, 8) for n in CELLS]
    numbers, repeats, mesh = REYNOLDS, 7, ELEMENTS
    if tiny:
        numbers, repeats, mesh = REYNOLDS[:1], 1, Elements(order=2, wall=0.2, near=0.5)
    progress(0.0, "cells")
    result: Result = {"rival": [], "missing": "", "cells": list(_cells(grids, repeats))}
    progress(0.25, "gradients")
    result["gradients"] = list(_gradients(standard, numbers, repeats))
    progress(0.5, "batches")
    result["batches"] = list(_batches(levels, BATCHES[:1] if tiny else BATCHES, repeats))
    progress(0.75, "finite elements")
    try:
        result["rival"] = list(_rival(standard, numbers, repeats, mesh))
    except InvalidInput as missing:
        result["missing"] = str(missing)
    return result | {"power": power_of(result["cells"], "cells", "seconds")}


def _cells(grids: list[Fidelity], repeats: int) -> Rows:
    """Cylinder at Re 10 on ever finer grids: seconds and memory of a drag."""
    for fidelity in grids:
        flow = Flow(Scene(family=ROUND, fidelity=fidelity))
        query = jnp.array([1.0]), jnp.asarray(10.0)
        compiled = jax.jit(flow.drag).lower(*query).compile()
        yield {
            "n": fidelity.cells,
            "cells": int(np.prod(flow.domain.lattice.shape)),
            "seconds": medians([lambda call=compiled, query=query: call(*query)], repeats)[0],
            "megabytes": megabytes(compiled),
        }


def _gradients(fidelity: Fidelity, numbers: Sequence[float], repeats: int) -> Rows:
    """What a gradient adds to a drag, in drags; the ellipse of aspect 2."""
    flow = Flow(Scene(fidelity=fidelity))
    body = jnp.asarray(flow.scene.family.ellipse(2.0))
    calls = jax.jit(flow.drag), flow.slope, jax.jit(jax.value_and_grad(flow.drag, argnums=(0, 1)))
    for reynolds in numbers:
        query = body, jnp.asarray(reynolds)
        drag, shape, both = medians([lambda f=f, q=query: f(*q) for f in calls], repeats)
        row = {"reynolds": reynolds, "ms": 1e3 * drag, "shape_gradient": shape / drag - 1}
        yield row | {"gradient_with_reynolds": both / drag - 1}


def _batches(levels: list[Fidelity], sizes: tuple[int, ...], repeats: int) -> Rows:
    """Flows per second of random bodies, each at its own Re: in turn, and in step."""
    for fidelity in levels:
        flow = Flow(Scene(fidelity=fidelity))
        calls = flow.labels, jax.jit(jax.vmap(flow.drag))
        for size in sizes:
            samples = held_out_samples(flow.scene, 0, size)
            turns, steps = medians([lambda f=f, s=samples: f(*s) for f in calls], repeats)
            row = {"fidelity": fidelity.name, "batch": size}
            yield row | {"in_turn": size / turns, "vmapped": size / steps}


def _rival(fidelity: Fidelity, numbers: Sequence[float], repeats: int, mesh: Elements) -> Rows:
    """Cylinder against finite elements, in turns, as a busy machine hurts both alike."""
    drag = jax.jit(Flow(Scene(family=ROUND, fidelity=fidelity)).drag)
    for reynolds in numbers:
        query, seconds, others = (jnp.array([1.0]), jnp.asarray(reynolds)), [], []
        for _ in range((repeats + 1) // 2):
            seconds += medians([lambda query=query: drag(*query)], 2 * repeats)
            others.append(solve_by_plane_elements({"aspect": 1.0}, reynolds, mesh))
        exact, ours = REFERENCES["unbounded"][reynolds], float(np.median(seconds))
        theirs = float(np.median([other.seconds for other in others]))
        row = {"reynolds": reynolds, "error": float(drag(*query)) / exact - 1, "ms": 1e3 * ours}
        row |= {"rival_error": others[0].cd / exact - 1, "rival_s": theirs}
        yield row | {"rival_unknowns": others[0].unknowns, "faster": theirs / ours}


def tables(result: Result) -> str:
    parts = [table(result[name], *texts) for name, texts in TABLES.items() if result[name]]
    growth = words("Time grows as cells to the power {power:.2f}.", **result)
    return "\n\n".join([*parts, " ".join([growth, result["missing"]]).strip()])


STUDY = Study("speed", measure, tables)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
