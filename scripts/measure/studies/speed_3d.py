"""Speed and errors of 3-D flows over cells, with gradients, and against finite elements."""

import dataclasses
import statistics
import time

import jax
import numpy as np
from correlations import ellipsoid, oberbeck
from elements import (
    AXISYMMETRIC,
    BOX,
    FLATTENED,
    TINY_ELEMENTS,
    reference_cd,
    solve_by_elements,
    stopwatch,
)
from meshes import Elements
from studies.accuracy_3d import CREEPING, SPHERE
from studies.speed import PAIR, RE, REYNOLDS, ROUND, TIME, drag_cost, query_of
from study import TINY, Result, Row, Run, Study, Table, cases, columns, words
from tools import cold_cache, medians, power_of, solved

from surrogate import Fidelity, Flow, Scene

FLAT = {"aspect": 2.0, "flatness": 2.0}
FLAT_MESHES = (BOX._replace(wall=0.2, near=0.5, wake=1.2), BOX)
SPHEROID = {"aspect": 2.0}
MESHES = (Elements(2, 12.0, 0.3, 0.8, 3.0), Elements(3, 30.0, 0.4, 1.0, 4.0))
EXACT = {
    "sphere": ({"aspect": 1.0}, RE, SPHERE[RE]),
    "ellipsoid": (FLAT, CREEPING, oberbeck(ellipsoid(*FLAT.values()), CREEPING)),
}


def cells_3d(run: Run, n: int) -> Row:
    """Return the errors of two bodies of known drag, and work, time and memory of the first."""
    n = run.pick(TINY.cells, n)
    fidelity = dataclasses.replace(run.fidelity("standard", 3), cells=n)
    found = {name: solved(body, re, fidelity, 3) for name, (body, re, _) in EXACT.items()}
    row = {name: found[name].drag / exact - 1 for name, (_, _, exact) in EXACT.items()}
    scene = Scene(family=ROUND[3], reynolds=(RE, RE), fidelity=fidelity)
    work = {"n": n, "work": found["sphere"].green_applications}
    return row | work | drag_cost(scene, run.pick(1, 3))


def levels_3d(run: Run, fidelity: str, reynolds: float) -> Row:
    """Return the time of a drag of the spheroid of aspect 2, and what a gradient adds to it.

    At the first Re the seconds of compilation are measured too.
    """
    scene = Scene(reynolds=(1.0, 40.0), family=ROUND[3], fidelity=run.fidelity(fidelity, 3))
    flow, query, row = Flow(scene), query_of(2.0, reynolds), {"compile_s": None}
    calls = jax.jit(flow.drag), jax.jit(jax.value_and_grad(flow.drag))
    if reynolds == REYNOLDS[0]:
        with cold_cache():
            start = time.perf_counter()
            calls[1].lower(*query).compile()
            row["compile_s"] = time.perf_counter() - start
    drag, both = medians([lambda f=f: f(*query) for f in calls], run.pick(1, 3))
    return row | {"seconds": drag, "gradient": both / drag}


def flat_solvers(run: Run) -> list[Row]:
    """Return the cases: flows and meshes for the flattened body."""
    flows = [run.fidelity(name, 3) for name in ("draft", "standard", "fine")]
    coarse = BOX._replace(box=6.0, wall=0.4, near=0.8, wake=2.0)
    return cases(solver=run.pick((TINY, coarse), (*flows, *FLAT_MESHES)))


def flat_rival(run: Run, solver: Fidelity | Elements) -> Row:
    """Return Cd of the flattened body by one flow or mesh, and processor seconds.

    Compilation is left out.
    """
    if isinstance(solver, Elements):
        found = solve_by_elements(FLATTENED, FLAT, RE, solver)
        return {"solver": f"elements, {solver.wall:g} D at the body"} | found._asdict()
    solved(FLAT, RE, solver, 3)
    start = time.process_time()
    found = solved(FLAT, RE, solver, 3)
    seconds, unknowns = time.process_time() - start, 3 * int(np.prod(found.domain.lattice.shape))
    return {"solver": solver.name, "unknowns": unknowns, "cd": found.drag, "seconds": seconds}


def flat_errors(run: Run, result: Result) -> Result:
    """Return the rows with their differences from the finest of the flows."""
    rows = result["rival"]
    finest = [row["cd"] for row in rows if not row["solver"].startswith("elements")][-1]
    return {"rival": [row | {"error": row["cd"] / finest - 1} for row in rows]}


def round_solvers(run: Run) -> list[Row]:
    """Return the cases: flows and meshes for the spheroid, at every Re."""
    flows = [run.fidelity(name, 3) for name in ("draft", "standard")]
    tiny = cases(reynolds=[1.0], solver=(TINY, TINY_ELEMENTS._replace(wall=0.4)))
    return run.pick(tiny, cases(reynolds=REYNOLDS, solver=(*flows, *MESHES)))


def round_rival(run: Run, reynolds: float, solver: Fidelity | Elements) -> Row:
    """Return Cd of the spheroid of aspect 2, its error against fine elements, and the seconds.

    Compilation is left out.
    """
    exact = reference_cd(AXISYMMETRIC, SPHEROID, reynolds, run.pick(TINY_ELEMENTS, None))
    times = range(run.pick(1, 5) + 1)
    if isinstance(solver, Elements):
        tries = [solve_by_elements(AXISYMMETRIC, SPHEROID, reynolds, solver) for _ in times]
        row = {"solver": f"elements of degree {solver.order}"} | tries[0]._asdict()
        seconds = [found.seconds for found in tries]
    else:
        flow = Flow(Scene(family=ROUND[3], reynolds=(1.0, 40.0), fidelity=solver))
        drag, query, seconds = jax.jit(flow.drag), query_of(2.0, reynolds), []
        for _ in times:
            watch = stopwatch()
            cd = float(drag(*query))
            seconds.append(watch())
        unknowns = 3 * int(np.prod(flow.domain.lattice.shape))
        row = {"solver": solver.name, "unknowns": unknowns, "cd": cd}
    return row | {"error": row["cd"] / exact - 1, "seconds": statistics.median(seconds[1:])}


def text_3d(result: Result) -> str:
    """Return a sentence on the order of the ellipsoid's error."""
    form = "The ellipsoid's error goes as cells per D to the power {power:.1f}; the rest of the "
    return words(
        f"{form}sphere's is the domain's.", power=power_of(result["cells"], "n", "ellipsoid")
    )


CELLS_3D = columns(
    f"cells per D {{n}} | cells {{cells}} | error of the sphere at Re {RE:g} {{sphere:+.3%}}"
    f" | of the ellipsoid at Re {CREEPING:g} {{ellipsoid:+.3%}} | G {{work}} | {TIME}"
)
LEVELS = columns(
    "fidelity {fidelity} | Re {reynolds:g} | a drag {seconds:.2f} s"
    " | with its gradient, in drags {gradient:.2f} | seconds of compilation {compile_s:.0f}"
)
SOLVER = "solver {solver} | unknowns {unknowns} | Cd {cd:.4f}"
FLAT_RIVAL = columns(
    SOLVER + " | difference from the finest flow {error:+.2%} | processor time {seconds:.1f} s"
)
ROUND_RIVAL = columns(
    f"Re {{reynolds:g}} | {SOLVER} | error against fine elements {{error:+.2%}}"
    " | time, without meshing {seconds:.2f} s"
)
STUDIES = {
    "space_speed": Study(
        [
            Table(cases(n=(6, 8, 10, 12, 16, 20, 24, 32)), cells_3d, CELLS_3D, "cells"),
            Table(cases(fidelity=PAIR, reynolds=REYNOLDS), levels_3d, LEVELS, "levels"),
            Table(flat_solvers, flat_rival, FLAT_RIVAL, "rival", "all"),
        ],
        text_3d,
        flat_errors,
    ),
    "space_rival": Study([Table(round_solvers, round_rival, ROUND_RIVAL, tiny="all")]),
}
