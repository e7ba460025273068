"""What lift costs: flows without a plane of symmetry, gradients of three loads, and memory."""

import functools
from pathlib import Path

import jax
import jax.numpy as jnp
from study import Row, Run, Study, Table, cases, columns
from tools import alone, medians, megabytes

from surrogate import Family, Flow, Scene, family_shape

CAMBERED = {"gamma2": 0.2, "incidence": 8.0}
SCENE = Path(__file__).parents[2] / "lift.toml"
TURNED = {2: 8.0, 3: 30.0}  # degrees, of the bodies whose memory is compared
FLOWS = cases(aspect=(2.0, 4.0), reynolds=(1.0, 40.0))
GRADIENTS = cases(aspect=(2.0, 3.5), reynolds=(5.0, 40.0, 90.0))  # below the onset
MEMORY = cases(dimension=(2, 3), fidelity=("draft", "standard"))


def flows(run: Run, aspect: float, reynolds: float) -> Row:
    """Compare a cambered 2-D body at incidence with the symmetric one of its aspect."""
    flow = Flow(Scene(fidelity=run.fidelity("standard")))
    shapes = [family_shape({"aspect": aspect} | more) for more in ({}, CAMBERED)]
    solve = functools.partial(flow.solve, reynolds=reynolds, estimate=False, allow_unsteady=True)
    calls = [functools.partial(alone, functools.partial(solve, shape)) for shape in shapes]
    work = [call().green_applications for call in calls]
    before, after = medians(calls, run.pick(1, 7))
    found = {"symmetric_work": work[0], "work": work[1], "symmetric_s": before, "seconds": after}
    return found | {"ratio": after / before}


def gradients(run: Run, aspect: float, reynolds: float) -> Row:
    """Compare a flow with the same flow and the gradients of its three loads."""
    family = Family(aspect=(1.5, 4.0), gamma2=(-0.3, 0.3), incidence=(-4.0, 12.0))
    scene = (
        Scene(family=family, fidelity=run.fidelity("standard")) if run.tiny else Scene.read(SCENE)
    )
    flow, given = Flow(scene), {"aspect": aspect} | CAMBERED
    body = jnp.array([given.get(name, 0.0) for name in scene.family.names])
    solve = functools.partial(flow.solve_all, body[None], reynolds, allow_unsteady=True)
    both_solved = functools.partial(solve, gradients=True)
    calls = [functools.partial(alone, call) for call in (solve, both_solved)]
    work, both = (int(call().green_applications[0]) for call in calls)
    seconds, all_s = medians(calls, run.pick(1, 7))
    row = {"work": work, "more_work": both - work, "seconds": seconds, "all_s": all_s}
    return row | {"work_ratio": both / work - 1, "ratio": all_s / seconds}


def memory(run: Run, dimension: int, fidelity: str) -> Row:
    """Compare the memory of compiled flows: bodies of aspect 2 aligned and at an incidence."""
    turn, level = TURNED[dimension], run.fidelity(fidelity, dimension)
    ranges = [{}, {"incidence": (turn - 0.1, turn + 0.1)}]
    found = []
    for more in ranges:
        family = Family(dimension=dimension, aspect=(1.9, 2.0), **more)
        flow = Flow(Scene(dimension=dimension, family=family, reynolds=(1.0, 10.0), fidelity=level))
        body = jnp.array([2.0, turn][: len(family.names)])
        found.append(megabytes(jax.jit(flow.drag).lower(body, jnp.asarray(10.0)).compile()))
    return {"aligned": found[0], "turned": found[1], "ratio": found[1] / found[0]}


TABLES = [
    Table(
        FLOWS,
        flows,
        columns(
            "aspect {aspect:g} | Re {reynolds:g} | symmetric {symmetric_work} G, "
            "{symmetric_s:.2f} s | cambered, at 8 degrees {work} G, {seconds:.2f} s"
            " | ratio of seconds {ratio:.2f}"
        ),
    ),
    Table(
        GRADIENTS,
        gradients,
        columns(
            "aspect {aspect:g} | Re {reynolds:g} | loads {work} G, {seconds:.2f} s"
            " | gradients of all loads, more {more_work} G | over the flow's {work_ratio:.2f}"
            " | loads and gradients {all_s:.2f} s | over the loads' {ratio:.2f}"
        ),
        key="gradients",
    ),
    Table(
        MEMORY,
        memory,
        columns(
            "dimension {dimension} | fidelity {fidelity} | aligned {aligned:.0f} MB"
            " | at incidence {turned:.0f} MB | ratio {ratio:.2f}"
        ),
        key="memory",
    ),
]
STUDIES = {"lift_cost": Study(TABLES)}
