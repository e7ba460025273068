"""How fast the 3-D flow is, and of what order: over cells, fidelities, beside elements."""

import dataclasses
import time
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from correlations import ellipsoid, oberbeck
from elements import BOX, FLATTENED, solve_by_elements
from meshes import Elements
from studies.flow_3d import CREEPING, SPHERE
from study import TINY, Result, Row, Run, Study, Table, columns, words
from tools import cold_cache, drag_cost, medians, power_of, solved

from surrogate import Family, Fidelity, Flow, Scene

NUMBERS = (1.0, 10.0, 40.0)
RE = 10.0  # of the sphere over cells, and of the flattened body
ROUND = Family(dimension=3, aspect=(1.0, 2.0))
FLAT = {"aspect": 2.0, "flatness": 2.0}
MESHES = (BOX._replace(wall=0.2, near=0.5, wake=1.2), BOX)
COARSE = BOX._replace(box=6.0, wall=0.4, near=0.8, wake=2.0)
EXACT = {
    "sphere": ({"aspect": 1.0}, RE, SPHERE[RE]),
    "ellipsoid": (FLAT, CREEPING, oberbeck(ellipsoid(*FLAT.values()), CREEPING)),
}


def grids(run: Run) -> list[Row]:
    return [{"n": n} for n in run.pick((TINY.cells,), (6, 8, 10, 12, 16, 20, 24, 32))]


def cells(run: Run, n: int) -> Row:
    """Errors of two bodies of known drag; work, time and memory of the first."""
    fidelity = dataclasses.replace(run.fidelity("standard", 3), cells=n)
    found = {name: solved(body, re, fidelity, 3) for name, (body, re, _) in EXACT.items()}
    row = {name: found[name].drag / exact - 1 for name, (_, _, exact) in EXACT.items()}
    scene = Scene(family=ROUND, reynolds=(RE, RE), fidelity=fidelity)
    work = {"work": found["sphere"].green_applications}
    return row | work | drag_cost(scene, [1.0], RE, run.pick(1, 3))


def fidelities(run: Run) -> Iterator[Row]:
    for name in ("draft", "standard"):
        for reynolds in NUMBERS:
            yield {"fidelity": run.fidelity(name, 3), "reynolds": reynolds}


def levels(run: Run, fidelity: Fidelity, reynolds: float) -> Row:
    """The spheroid of aspect 2: a drag, what a gradient adds, and at the first Re compilation."""
    flow = Flow(Scene(family=ROUND, reynolds=(NUMBERS[0], NUMBERS[-1]), fidelity=fidelity))
    calls = jax.jit(flow.drag), jax.jit(jax.value_and_grad(flow.drag))
    query, row = (jnp.array([2.0]), jnp.asarray(reynolds)), {"compile_s": None}
    if reynolds == NUMBERS[0]:
        with cold_cache():
            start = time.perf_counter()
            calls[1].lower(*query).compile()
            row["compile_s"] = time.perf_counter() - start
    drag, both = medians([lambda f=f: f(*query) for f in calls], run.pick(1, 3))
    return row | {"seconds": drag, "gradient": both / drag}


def solvers(run: Run) -> list[Row]:
    flows = [run.fidelity(name, 3) for name in ("draft", "standard", "fine")]
    return [{"solver": solver} for solver in run.pick((TINY, COARSE), (*flows, *MESHES))]


def rival(run: Run, solver: Fidelity | Elements) -> Row:
    """The flattened body by one flow or mesh, with processor seconds without compilation."""
    if isinstance(solver, Elements):
        found = solve_by_elements(FLATTENED, FLAT, RE, solver)
        return {"way": f"elements, {solver.wall:g} D at the body"} | found._asdict()
    solved(FLAT, RE, solver, 3)
    start = time.process_time()
    found = solved(FLAT, RE, solver, 3)
    seconds, unknowns = time.process_time() - start, 3 * int(np.prod(found.domain.lattice.shape))
    return {"way": solver.name, "unknowns": unknowns, "cd": found.drag, "seconds": seconds}


def errors(run: Run, result: Result) -> Result:
    """Differences from the finest of the flows."""
    rows = result["rival"]
    finest = [row["cd"] for row in rows if not row["way"].startswith("elements")][-1]
    return {"rival": [row | {"error": row["cd"] / finest - 1} for row in rows]}


def text(result: Result) -> str:
    form = "The ellipsoid's error goes as cells per D to the power {power:.1f}; the rest of the "
    form += "sphere's is the domain's."
    return words(form, power=power_of(result["cells"], "n", "ellipsoid"))


CELLS = f"cells per D {{n}} | cells {{cells}} | error of the sphere at Re {RE:g} {{sphere:+.3%}}"
CELLS += f" | of the ellipsoid at Re {CREEPING:g} {{ellipsoid:+.3%}} | G {{work}}"
CELLS += " | time {seconds:.2f} s | memory {megabytes:.0f} MB"
LEVELS = "fidelity {fidelity} | Re {reynolds:g} | a drag {seconds:.2f} s"
LEVELS += " | with its gradient, in drags {gradient:.2f} | seconds of compilation {compile_s:.0f}"
RIVAL = "solver {way} | unknowns {unknowns} | Cd {cd:.4f} | difference from the finest flow "
RIVAL += "{error:+.2%} | processor time {seconds:.1f} s"
TABLES = [
    Table(grids, cells, columns(CELLS), "cells"),
    Table(fidelities, levels, columns(LEVELS), "levels"),
    Table(solvers, rival, columns(RIVAL), "rival", "all"),
]
STUDY = Study(TABLES, text, extra=errors)
