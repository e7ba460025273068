"""How fast the flow in space is, and of what order: over cells, levels, beside elements.

python scripts/measure/space_speed.py

The elements need NGSolve: pip install -e '.[bench]'.
"""

import dataclasses
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from correlations import ellipsoid, oberbeck
from elements import Elements
from flattened import MESH, solve_by_elements_in_space
from space import CREEPING, SPHERE, TINY
from study import Result, Study, cold_cache, medians, megabytes, power_of, run_study, table, words

from surrogate import Family, Fidelity, Flow, InvalidInput, Scene, family_shape
from surrogate.scene.fidelity import SPACE_FIDELITIES

CELLS = (6, 8, 10, 12, 16, 20, 24, 32)
NUMBERS = (1.0, 10.0, 40.0)
RE = 10.0  # of the sphere over cells, and of the flattened body
ROUND = Family(dimension=3, aspect=(1.0, 2.0))
ASPECT, FLATNESS = 2.0, 2.0  # of the flattened body
MESHES = (MESH._replace(wall=0.2, near=0.5, wake=1.2), MESH)
COARSE = MESH._replace(box=6.0, wall=0.4, near=0.8, wake=2.0)
Rows = Iterator[dict[str, Any]]

TABLES = {  # heads and formats
    "cells": (
        f"cells per D | cells | sphere at Re {RE:g} off by | ellipsoid at Re {CREEPING:g} off by"
        " | G | time | memory",
        "{n} | {cells} | {sphere:+.3%} | {ellipsoid:+.3%} | {work} | {seconds:.2f} s"
        " | {megabytes:.0f} MB",
    ),
    "levels": (
        "fidelity | Re | a drag | with its gradient, in drags | compilation, cache cold",
        "{fidelity} | {reynolds:g} | {seconds:.2f} s | {gradient:.2f} | {compiling}",
    ),
    "rival": (
        "way | unknowns | Cd | off the finest flow by | processor time",
        "{way} | {unknowns} | {cd:.4f} | {error:+.2%} | {seconds:.1f} s",
    ),
}


def measure(tiny: bool, progress: Callable) -> Result:
    """Three tables; what is missing where NGSolve is."""
    standard = TINY if tiny else SPACE_FIDELITIES["standard"]
    levels = [TINY] if tiny else [SPACE_FIDELITIES[name] for name in ("draft", "standard")]
    cells = (TINY.cells,) if tiny else CELLS
    result: Result = {"cells": [], "rival": [], "missing": ""}
    for k, n in enumerate(cells):
        progress(0.5 * k / len(cells), f"{n} cells per D")
        result["cells"].append(_cells(dataclasses.replace(standard, cells=n), 1 if tiny else 3))
    progress(0.5, "levels")
    result["levels"] = list(_levels(levels, NUMBERS[: 1 if tiny else None], 1 if tiny else 3))
    progress(0.7, "elements")
    try:
        finest = [standard] if tiny else [*levels, SPACE_FIDELITIES["fine"]]
        result["rival"] = _rival(finest, (COARSE,) if tiny else MESHES)
    except InvalidInput as missing:
        result["missing"] = str(missing)
    return result


BODIES = {
    "sphere": ({"aspect": 1.0}, RE, SPHERE[RE]),
    "ellipsoid": (
        {"aspect": ASPECT, "flatness": FLATNESS},
        CREEPING,
        oberbeck(ellipsoid(ASPECT, FLATNESS), CREEPING),
    ),
}


def _cells(fidelity: Fidelity, repeats: int) -> dict[str, Any]:
    """Two bodies whose drag is known; time, memory and work of the first."""
    flow = Flow(Scene(dimension=3, fidelity=fidelity))
    solved = {
        name: flow.solve(family_shape(body, dimension=3), re, estimate=False)
        for name, (body, re, _) in BODIES.items()
    }
    row = {name: found.drag / BODIES[name][2] - 1 for name, found in solved.items()}
    scene = Scene(family=ROUND, reynolds=(RE, RE), fidelity=fidelity)
    drag, query = Flow(scene).drag, (jnp.array([1.0]), jnp.asarray(RE))
    compiled = jax.jit(drag).lower(*query).compile()
    return row | {
        "n": fidelity.cells,
        "cells": int(np.prod(Flow(scene).domain.lattice.shape)),
        "work": solved["sphere"].green_applications,
        "seconds": medians([lambda: compiled(*query)], repeats)[0],
        "megabytes": megabytes(compiled),
    }


def _levels(levels: Sequence[Fidelity], numbers: Sequence[float], repeats: int) -> Rows:
    """The spheroid of aspect 2: a drag, what a gradient adds, and compiling both."""
    for fidelity in levels:
        flow = Flow(Scene(family=ROUND, reynolds=(min(numbers), max(numbers)), fidelity=fidelity))
        calls = jax.jit(flow.drag), jax.jit(jax.value_and_grad(flow.drag))
        for k, re in enumerate(numbers):
            query = jnp.array([ASPECT]), jnp.asarray(re)
            compile_s = None if k else compiling(calls[1], *query)
            drag, both = medians([lambda f=f, q=query: f(*q) for f in calls], repeats)
            row = {"fidelity": fidelity.name, "reynolds": re, "compile_s": compile_s}
            yield row | {"seconds": drag, "gradient": both / drag}


def compiling(call: Any, *arguments: Any) -> float:
    """Seconds of compiling, with nothing kept from before."""
    with cold_cache():
        start = time.perf_counter()
        call.lower(*arguments).compile()
        return time.perf_counter() - start


def _rival(levels: Sequence[Fidelity], meshes: Sequence[Elements]) -> list[dict[str, Any]]:
    """The flattened body by flows and by elements, beside the last of the flows."""
    rows, body = [], {"aspect": ASPECT, "flatness": FLATNESS}
    for fidelity in levels:
        flow, shape = Flow(Scene(dimension=3, fidelity=fidelity)), family_shape(body, dimension=3)
        flow.solve(shape, RE, estimate=False)
        start = time.process_time()
        found = flow.solve(shape, RE, estimate=False)
        seconds, shape = time.process_time() - start, found.domain.lattice.shape
        row = {"way": fidelity.name, "unknowns": 3 * int(np.prod(shape)), "cd": found.drag}
        rows.append(row | {"seconds": seconds})
    for mesh in meshes:
        elements = solve_by_elements_in_space(body, RE, mesh)
        way = f"elements, {mesh.wall:g} D at the body"
        rows.append({"way": way} | elements._asdict())
    finest = rows[len(levels) - 1]["cd"]
    return [row | {"error": row["cd"] / finest - 1} for row in rows]


def tables(result: Result) -> str:
    levels = [
        row | {"compiling": "-" if row["compile_s"] is None else f"{row['compile_s']:.0f} s"}
        for row in result["levels"]
    ]
    result = {**result, "levels": levels}
    parts = [table(result[name], *texts) for name, texts in TABLES.items() if result[name]]
    power = power_of(result["cells"], "n", "ellipsoid")
    form = "The ellipsoid's error goes as cells per D to the power {power:.1f}; what stays of the "
    told = words(f"{form}sphere's is the window's.", power=power)
    return "\n\n".join([*parts, f"{told} {result['missing']}".strip()])


STUDY = Study("space_speed", measure, tables)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
