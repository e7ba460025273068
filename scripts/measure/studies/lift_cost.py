"""What lift costs: flows without a plane of symmetry, gradients of three loads, and memory."""

import dataclasses
import functools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from study import Row, Run, Study, Table, cases, columns
from tools import alone, medians, megabytes

from surrogate import Family, Flow, NotConverged, Scene, family_shape
from surrogate.flow import programs
from surrogate.flow.derivatives import quick_efforts
from surrogate.flow.loads import LOADS, load_values
from surrogate.flow.solver.adjoint import Effort
from surrogate.model.inputs import scene_inputs
from surrogate.model.outputs import gradients_of_outputs
from surrogate.scene.samples import training_samples

CAMBERED = {"gamma2": 0.2, "incidence": 8.0}
SCENES = {2: "lift.toml", 3: "particle.toml"}  # those of the shipped surrogates
TURNED = {2: 8.0, 3: 30.0}  # degrees, of the bodies whose memory is compared
FLOWS = cases(aspect=(2.0, 4.0), reynolds=(1.0, 40.0))
GRADIENTS = cases(aspect=(2.0, 3.5), reynolds=(5.0, 40.0, 90.0))
GRADIENTS += cases(aspect=[3.5], reynolds=[150.0])
MEMORY = cases(dimension=(2, 3), fidelity=("draft", "standard"))
TOLERANCES = (1e-4, 2e-4, 3e-4, 7e-4, 2e-3)  # of adjoints
EXACT = 1e-6


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
    scene = Scene(family=family, fidelity=run.fidelity("standard")) if run.tiny else _read(2)
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


def adjoints(run: Run, dimension: int) -> list[Row]:
    """Return the errors of gradients, and their convolutions, for several tolerances of adjoints.

    They are errors of what networks and kriging are fitted to: the slopes of log Cd, Cl / Cd and
    Cm / Cd in scaled inputs.

    Args:
      run: How the study is run.
      dimension: 2 for the scene of ``pretrained:lift``, 3 for that of ``pretrained:particle`` on a
        coarser grid.

    Raises:
      NotConverged: A flow or an adjoint has not converged.
    """
    flow = Flow(_scene(run, dimension))
    bodies, domain, inputs = flow.bodies, flow.domain, scene_inputs(flow.scene)
    samples = training_samples(flow.scene, 1, run.pick(1, 8))
    pairs = zip(samples.parameters, map(jnp.asarray, samples.reynolds), strict=True)
    solved = [
        (*at, programs.stream_derivatives(domain, at[1]), *bodies.solved(*at)) for at in pairs
    ]
    if not all(info.converged for *_, info in solved):
        raise NotConverged("adjoints: a flow has not converged")

    def slopes(efforts):
        rows, work = [], 0
        for body, re, stream, operators, state, _ in solved:
            found = programs.load_gradients(bodies.loads, domain, operators, state, re, efforts)
            if not found.work.converged:
                raise NotConverged(f"adjoints: one at Re {re:g} has not converged")
            by_re = found.by_reynolds + programs.by_stream(
                domain, operators, state, stream, found.adjoints, efforts
            )
            by_body = bodies.in_parameters(body, found.by_markers)
            loads = load_values(domain.modes, bodies.loads, state.amplitude, operators.markers)
            by_inputs = gradients_of_outputs(loads, jnp.column_stack([by_body, re * by_re]))
            rows.append(np.asarray(by_inputs * inputs.steepness(body)))
            work += int(found.work.convolutions)
        return np.array(rows), work / len(solved)

    exact, _ = slopes((Effort(EXACT, 80),) * len(bodies.loads))
    trials = [(Effort(value, 80),) * len(bodies.loads) for value in TOLERANCES]
    rows = []
    for efforts in (*trials, quick_efforts(bodies.loads)):
        found, work = slopes(efforts)
        tolerances = dict.fromkeys(f"{one.tolerance:g}" for one in efforts)
        row = {"tolerance": ", ".join(tolerances), "work": work}
        for load, errors in zip(LOADS, np.moveaxis(found - exact, 1, 0), strict=True):
            row |= {load: np.sqrt(np.mean(errors**2)), f"{load}_most": np.abs(errors).max()}
        rows.append(row)
    return rows


def _scene(run, dimension):
    scene = _read(dimension)
    coarse = dataclasses.replace(scene.fidelity, cells=run.pick(5, 10))
    fidelity = run.fidelity("standard") if dimension == 2 else coarse
    return dataclasses.replace(scene, fidelity=fidelity)


def _read(dimension):
    return Scene.read(Path(__file__).parents[2] / SCENES[dimension])


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
            " | gradients of all loads, more {more_work} G"
            " | more G over the flow's {work_ratio:.2f}"
            " | loads and gradients {all_s:.2f} s | seconds over the loads' {ratio:.2f}"
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
    Table(
        cases(dimension=(2, 3)),
        adjoints,
        columns(
            "dimension {dimension} | tolerance: of all loads, or of Cd, then Cl and Cm {tolerance}"
            " | G a body {work:.1f}"
            " | error of slopes of log Cd: rms, largest {cd:.1e}, {cd_most:.1e}"
            " | of Cl / Cd {cl:.1e}, {cl_most:.1e} | of Cm / Cd {cm:.1e}, {cm_most:.1e}"
        ),
        key="adjoints",
        tiny="all",
    ),
]
STUDIES = {"lift_cost": Study(TABLES)}
