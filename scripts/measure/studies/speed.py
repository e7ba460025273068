"""Speed of flows and surrogates: over cells, with gradients, in batches, against elements."""

import dataclasses
import functools
import statistics
import time
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from correlations import ellipsoid, oberbeck
from elements import (
    AXISYMMETRIC,
    BOX,
    FLATTENED,
    PLANE,
    TINY_ELEMENTS,
    reference_cd,
    solve_by_elements,
    stopwatch,
)
from meshes import Elements
from studies.accuracy import REFERENCES
from studies.accuracy_3d import CREEPING, SPHERE
from study import TINY, Result, Row, Run, Study, Table, cases, columns, words
from tools import cold_cache, medians, megabytes, power_of, solved

from surrogate import Family, Fidelity, Flow, Scene, load
from surrogate.flow.streams import forget_operators
from surrogate.scene.samples import held_out_samples

REYNOLDS = (1.0, 10.0, 40.0)
RE = 10.0  # of the grids, and of the flattened body
ROUND = {  # families of little more than the circle, and than the spheroid of aspect 2
    2: Family(aspect=(1.0, 1.2)),
    3: Family(dimension=3, aspect=(1.0, 2.0)),
}
FLAT = {"aspect": 2.0, "flatness": 2.0}
FLAT_MESHES = (BOX._replace(wall=0.2, near=0.5, wake=1.2), BOX)
SPHEROID = {"aspect": 2.0}
MESHES = (Elements(2, 12.0, 0.3, 0.8, 3.0), Elements(3, 30.0, 0.4, 1.0, 4.0))
EXACT = {
    "sphere": ({"aspect": 1.0}, RE, SPHERE[RE]),
    "ellipsoid": (FLAT, CREEPING, oberbeck(ellipsoid(*FLAT.values()), CREEPING)),
}


def _query(body: float, reynolds: float) -> tuple[jax.Array, jax.Array]:
    return jnp.array([body]), jnp.asarray(reynolds)


def drag_cost(scene: Scene, repeats: int) -> Row:
    """Return the cells of a scene's grid, and seconds and memory of the drag of a round body."""
    flow, query = Flow(scene), _query(1.0, RE)
    compiled = jax.jit(flow.drag).lower(*query).compile()
    seconds = medians([lambda: compiled(*query)], repeats)[0]
    cells = int(np.prod(flow.domain.lattice.shape))
    return {"cells": cells, "seconds": seconds, "megabytes": megabytes(compiled)}


def cells(run: Run, n: int) -> Row:
    """Return the cost of the drag of the cylinder on a grid of ``n`` cells per D."""
    fidelity = run.pick(TINY, Fidelity("", n, 6, 12, 8))
    return drag_cost(Scene(family=ROUND[2], fidelity=fidelity), run.pick(1, 7))


def cells_3d(run: Run, n: int) -> Row:
    """Return the errors of two bodies of known drag, and work, time and memory of the first."""
    n = run.pick(TINY.cells, n)
    fidelity = dataclasses.replace(run.fidelity("standard", 3), cells=n)
    found = {name: solved(body, re, fidelity, 3) for name, (body, re, _) in EXACT.items()}
    row = {name: found[name].drag / exact - 1 for name, (_, _, exact) in EXACT.items()}
    scene = Scene(family=ROUND[3], reynolds=(RE, RE), fidelity=fidelity)
    work = {"n": n, "work": found["sphere"].green_applications}
    return row | work | drag_cost(scene, run.pick(1, 3))


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

        def alone(call=call):
            forget_operators()
            return call(*query)

        alone_s, kept_s = medians([alone, functools.partial(call, *query)], run.pick(1, 7))
        row |= {name: 1e3 * alone_s, f"{name}_kept": 1e3 * kept_s}
    return row


def levels_3d(run: Run, fidelity: str, reynolds: float) -> Row:
    """Return the time of a drag of the spheroid of aspect 2, and what a gradient adds to it.

    At the first Re the seconds of compilation are measured too.
    """
    scene = Scene(reynolds=(1.0, 40.0), family=ROUND[3], fidelity=run.fidelity(fidelity, 3))
    flow, query, row = Flow(scene), _query(2.0, reynolds), {"compile_s": None}
    calls = jax.jit(flow.drag), jax.jit(jax.value_and_grad(flow.drag))
    if reynolds == REYNOLDS[0]:
        with cold_cache():
            start = time.perf_counter()
            calls[1].lower(*query).compile()
            row["compile_s"] = time.perf_counter() - start
    drag, both = medians([lambda f=f: f(*query) for f in calls], run.pick(1, 3))
    return row | {"seconds": drag, "gradient": both / drag}


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
    query, seconds, others = _query(1.0, reynolds), [], []
    mesh = run.pick(Elements(order=2, wall=0.2, near=0.5), None)
    for _ in range(run.pick(1, 4)):
        others.append(solve_by_elements(PLANE, {"aspect": 1.0}, reynolds, mesh))
        seconds += medians([lambda: drag(*query)], run.pick(2, 14))
    exact, ours = REFERENCES["unbounded"][reynolds], float(np.median(seconds))
    theirs = float(np.median([other.seconds for other in others]))
    row = {"error": float(drag(*query)) / exact - 1, "ms": 1e3 * ours}
    row |= {"rival_error": others[0].cd / exact - 1, "rival_s": theirs}
    return row | {"rival_unknowns": others[0].unknowns, "faster": theirs / ours}


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
        drag, query, seconds = jax.jit(flow.drag), _query(2.0, reynolds), []
        for _ in times:
            watch = stopwatch()
            cd = float(drag(*query))
            seconds.append(watch())
        unknowns = 3 * int(np.prod(flow.domain.lattice.shape))
        row = {"solver": solver.name, "unknowns": unknowns, "cd": cd}
    return row | {"error": row["cd"] / exact - 1, "seconds": statistics.median(seconds[1:])}


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


def text_3d(result: Result) -> str:
    """Return a sentence on the order of the ellipsoid's error."""
    form = "The ellipsoid's error goes as cells per D to the power {power:.1f}; the rest of the "
    return words(
        f"{form}sphere's is the domain's.", power=power_of(result["cells"], "n", "ellipsoid")
    )


TIME = "time {seconds:.2f} s | memory {megabytes:.0f} MB"
CELLS = columns("cells per D {n} | cells {cells} | " + TIME.replace(".2f", ".3f"))
CELLS_3D = columns(
    f"cells per D {{n}} | cells {{cells}} | error of the sphere at Re {RE:g} {{sphere:+.3%}}"
    f" | of the ellipsoid at Re {CREEPING:g} {{ellipsoid:+.3%}} | G {{work}} | {TIME}"
)
GRADIENTS = columns(
    "Re {reynolds:g} | drag {drag:.0f} ms, {drag_kept:.0f} ms"
    " | with gradient as in designs {designs:.0f} ms, {designs_kept:.0f} ms"
    " | with jax.grad by the body {body:.0f} ms, {body_kept:.0f} ms"
    " | by body and Re {reynolds_grad:.0f} ms, {reynolds_grad_kept:.0f} ms"
)
LEVELS = columns(
    "fidelity {fidelity} | Re {reynolds:g} | a drag {seconds:.2f} s"
    " | with its gradient, in drags {gradient:.2f} | seconds of compilation {compile_s:.0f}"
)
BATCHES = columns(
    "fidelity {fidelity} | batch {batch} | flows per s, one by one {in_turn:.1f}"
    " | vmapped {vmapped:.1f}"
)
RIVAL = columns(
    "Re {reynolds:g} | flow {ms:.0f} ms | error {error:+.2%} | finite elements {rival_s:.2f} s"
    " | error {rival_error:+.2%} | speedup of the flow {faster:.0f}"
)
SOLVER = "solver {solver} | unknowns {unknowns} | Cd {cd:.4f}"
FLAT_RIVAL = columns(
    SOLVER + " | difference from the finest flow {error:+.2%} | processor time {seconds:.1f} s"
)
ROUND_RIVAL = columns(
    f"Re {{reynolds:g}} | {SOLVER} | error against fine elements {{error:+.2%}}"
    " | time, without meshing {seconds:.2f} s"
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
    "network": Study([Table(answers, surrogate, CALLS, tiny="all")]),
}
