"""Accuracy of the 2-D flow and its gradients: references, grids, precision, marching in time."""

import contextlib
import dataclasses
import functools
import sys
import tempfile
from unittest import mock

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from study import TINY, Result, Row, Run, Study, Table, cases, columns, maps, panel, words
from tools import medians, solved

from shapeopt.commands.march_flow import main as march
from surrogate import (
    FIDELITIES,
    Fidelity,
    Flow,
    NotConverged,
    Scene,
    Unbounded,
    family_shape,
    load,
)
from surrogate.arrays import single
from surrogate.flow.grid import far
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.flow.grid.domain_3d import Domain3D
from surrogate.flow.solver import steady
from surrogate.scene.samples import Samples, held_out_samples
from surrogate.training.plan import METHODS

# cylinder, body-fitted finite elements with the far field removed, uncertainty about 1e-4
REFERENCES = {
    "unbounded": {1.0: 10.335, 5.0: 3.930, 10.0: 2.754, 20.0: 1.999, 40.0: 1.497},
    "tunnel:16": {1.0: 13.743, 10.0: 3.072, 40.0: 1.625},
    "tunnel:8": {1.0: 18.412, 10.0: 3.548, 40.0: 1.841},
}
CYLINDER = {"aspect": 1.0}
SLENDER = {"aspect": 4.0, "beta2": 0.2, "beta3": 0.1, "beta4": 0.05}
FINEST = Fidelity("finest", 40, 10, 24, 16, wake=0.3)  # with twice the cells of a flow or more
DOMAINS = ((3, 5, 6), (4, 8, 8), (6, 12, 8), (8, 16, 12))  # upstream, downstream, height
LARGEST = Fidelity("largest", 10, 10, 24, 16, wake=0.0)


def flows(run: Run) -> list[Row]:
    """Return the cases: fidelities against elements and over their range; cells; domains."""
    at, few = "Re {reynolds:g}", (1.0, 10.0, 40.0)
    if run.tiny:
        truths = cases(fidelity=[TINY], reynolds=[1.0], truth=[REFERENCES["unbounded"][1.0], TINY])
        return panel("accuracy", "tiny", at, truths[:1]) + panel("order", "tiny", at, truths[1:])
    levels = FIDELITIES.values()
    known = [
        {"fidelity": level, "stream": stream, "reynolds": re, "truth": drag}
        for level in levels
        for stream, drags in REFERENCES.items()
        for re, drag in drags.items()
    ]
    ellipses = [{"aspect": aspect} for aspect in (0.5, 1.0, 2.0, 5.0)]
    wide = {"reynolds": (0.5, 5.0, 45.0), "truth": [FINEST]}
    *grids, fine = (Fidelity("order", n, 3, 5, 5, wake=0.0) for n in (8, 12, 16, 24, 40))
    fixed = {"fidelity": grids, "reynolds": few, "truth": [fine]}
    domains = [Fidelity("domain", 10, *sizes, wake=0.0) for sizes in DOMAINS]
    size = "{fidelity.upstream:g} + {fidelity.downstream:g} by {fidelity.height:g}"
    aspect, n = "{fidelity.name}, aspect {body[aspect]:g}", "{fidelity.cells}"
    return [
        *panel("accuracy", "{fidelity.name}, {stream}", at, known),
        *panel("range", aspect, at, cases(fidelity=levels, body=ellipses, **wide)),
        *panel("order", f"cylinder, n = {n}", at, cases(**fixed)),
        *panel("order", f"slender body, n = {n}", at, cases(body=[SLENDER], **fixed)),
        *panel("domain", size, at, cases(fidelity=domains, reynolds=few, truth=[LARGEST])),
    ]


def flow_error(run, reynolds, fidelity, truth, body=CYLINDER, stream="unbounded", **_) -> Row:
    """Return drag, error, work, and the seconds of a second solve, without compilation.

    Args:
      run: How the study is run.
      reynolds: U D / nu.
      fidelity: Of the flow.
      truth: The exact Cd, or a finer fidelity.
      body: Parameters of the family by name.
      stream: As for ``parse_stream``.
      **_: The case's place in the maps.
    """
    solved(body, reynolds, fidelity, stream=stream)
    found = solved(body, reynolds, fidelity, stream=stream)
    if truth is FINEST:
        cells = max(FINEST.cells, 2 * found.fidelity.cells)
        truth = dataclasses.replace(FINEST, cells=cells, refinement=1.0)
    if isinstance(truth, Fidelity):
        truth = _drag_once(tuple(body.items()), reynolds, truth)
    drag = {"cd": found.drag, "reference": truth, "error": found.drag / truth - 1}
    return drag | {"green_applications": found.green_applications, "seconds": found.seconds}


@functools.cache
def _drag_once(body: tuple, reynolds: float, fidelity: Fidelity) -> float:
    return solved(dict(body), reynolds, fidelity).drag


def gradient_error(run: Run, gradient: str) -> Row:
    """Return the distances from the adjoint's gradient on the standard and on the fine grid.

    Raises:
      NotConverged: A flow or an adjoint of a body has not converged.
    """
    bodies = held_out_samples(Scene(), 0, run.pick(2, 64))
    if gradient in METHODS:
        drag = load(f"pretrained:{gradient}").network.drag
        found = np.asarray(jax.vmap(jax.grad(drag))(*bodies))
    else:
        found = _slopes_once(run.fidelity(gradient.removeprefix("adjoint, ")), bodies.count)
    widths = np.ptp(Scene().family.bounds, axis=1)
    return {
        name: distance(found, _slopes_once(run.fidelity(name), bodies.count), widths)
        for name in ("standard", "fine")
    }


@functools.cache
def _slopes_once(fidelity: Fidelity, count: int) -> np.ndarray:
    found = adjoint_slopes(Flow(Scene(fidelity=fidelity)), held_out_samples(Scene(), 0, count))
    if not np.isfinite(found).all():
        raise NotConverged(f"gradients: a flow or an adjoint on the {fidelity.name} grid")
    return found


def adjoint_slopes(flow: Flow, bodies: Samples) -> np.ndarray:
    """Return the shape gradients of the drag; NaN where flow or adjoint did not converge."""
    every = {"allow_unsteady": True, "partial": True}
    return np.array(
        [flow.loads_and_gradients(*one, **every).gradient for one in zip(*bodies, strict=True)]
    )


def distance(gradient: np.ndarray, truth: np.ndarray, widths: np.ndarray) -> float:
    """Return the median of |g - truth| / |truth| over bodies, parameters scaled by their ranges.

    Bodies without a gradient are left out.
    """
    error = np.linalg.norm((gradient - truth) * widths, axis=1)
    return float(np.nanmedian(error / np.linalg.norm(truth * widths, axis=1)))


def single_precision(run: Run, aspect: float, incidence: float, reynolds: float) -> Row:
    """Solve in both precisions with the same operators, and compare work, forces and time.

    The difference is that of Cd or Cl, whichever is larger, over Cd.
    """
    shape = family_shape({"aspect": aspect, "incidence": incidence})
    domain = fitted_domain(Unbounded(), run.fidelity("standard"), shape, reynolds)
    markers, re = jnp.asarray(shape.draw(domain.nodes)), jnp.asarray(reynolds)
    double = jax.jit(lambda markers, re: steady.assemble(domain, markers, re))(markers, re)
    solve = jax.jit(lambda operators: steady.body_flow(domain, operators))
    both = double, single(double)
    (a, info), (b, rough) = map(solve, both)
    seconds = medians([lambda operators=operators: solve(operators) for operators in both], 5)
    forces = np.array([domain.forces(state.amplitude) for state in (a, b)])
    difference = np.abs(forces[1] - forces[0]).max() / -forces[0, 0]
    return {
        "double": int(info.convolutions) if info.converged else None,
        "single": int(rough.convolutions) if rough.converged else None,
        "difference": float(difference) if info.converged & rough.converged else None,
        "time_ratio": seconds[1] / seconds[0],
    }


def far_precision(run: Run, aspect: float, incidence: float, reynolds: float) -> Row:
    """Return the change of a 3-D body's forces over its drag by a far field in double precision."""
    shape = family_shape({"aspect": aspect, "incidence": incidence}, dimension=3)
    domain = fitted_domain(Unbounded(), run.fidelity("draft", 3), shape, reynolds)
    re = jnp.asarray(reynolds)
    operators = jax.jit(lambda: steady.assemble(domain, shape.markers(domain.nodes), re))()
    with mock.patch.object(Domain3D, "FAR_PRECISION", jnp.float64):
        response = far.far_response(domain, re)
    solve = jax.jit(lambda operators: steady.body_flow(domain, operators))
    both = operators, eqx.tree_at(lambda operators: operators.far, operators, response)
    found = [solve(each) for each in both]
    forces = np.array([domain.forces(state.amplitude) for state, _ in found])
    change = np.abs(forces[1] - forces[0]).max() / -forces[0, 0]
    return {"change": float(change) if all(info.converged for _, info in found) else None}


def marched(run: Run, reynolds: float) -> Row:
    """March the cylinder in time by the command ``march_flow.py``, and return its result."""
    few = run.pick(["--time", "5", "--height", "6"], [])
    with tempfile.TemporaryDirectory() as out, contextlib.redirect_stdout(sys.stderr):
        argv = ["--aspect", "1", "--reynolds", f"{reynolds:g}", "--out", out, *few]
        return march(argv) | {"gif": None}


def march_text(result: Result) -> str:
    """Return one line of text per Reynolds number."""
    lines = [words("Blockage of the periodic domain: {blockage:.3f}.", **result["rows"][0])]
    for row in result["rows"]:
        form = "- Re {reynolds:g}: mean Cd {cd_mean:.4f}, Cl ±{cl_amplitude:.3f}, Strouhal number "
        form, gap = form + "{strouhal:.4f}", None
        if row["cd_steady"]:
            form = "- Re {reynolds:g}: Cd {cd:.4f} at the end; the steady flow has {cd_steady:.4f}"
            form, gap = form + " ({gap:+.2%})", row["cd"] / row["cd_steady"] - 1
        if row.get("growth_rate") is not None:
            form += ", the lift's amplitude changes at the rate {growth_rate:+.4f} U / D"
        lines.append(words(form, gap=gap, **row))
    return "\n".join(lines)


FLOW = maps(lambda row: words("{error:+.2%} in {seconds:.3f} s", **row))
GRADIENTS = columns(
    "gradient {gradient} | error against the standard adjoint {standard:.1%}"
    " | against the fine adjoint {fine:.1%}"
)
SOURCES = cases(gradient=[*(f"adjoint, {name}" for name in FIDELITIES), *METHODS])
PRECISION = columns(
    "aspect {aspect:g} | incidence {incidence:g} | Re {reynolds:g} | float64 {double} G"
    " | float32 {single} G | difference of Cd, Cl {difference:.0e}"
    " | time, float32 over float64 {time_ratio:.2f}"
)
FAR_PRECISION = columns(
    "aspect, in 3-D {aspect:g} | incidence {incidence:g} | Re {reynolds:g}"
    " | difference of Cd, Cl by the far field's precision {change:.0e}"
)
SPHEROIDS = cases(aspect=[0.6, 2.0], incidence=[0.0, 30.0], reynolds=[0.001, 1.0, 40.0])
ELLIPSES = [
    *cases(aspect=[1.0], incidence=[0.0], reynolds=[1.0, 1e-3, 0.1, 10.0, 40.0, 100.0, 300.0]),
    *cases(aspect=[0.5, 5.0], incidence=[0.0], reynolds=[40.0]),
    {"aspect": 10.0, "incidence": 0.0, "reynolds": 300.0},
    *cases(aspect=[3.0], incidence=[10.0], reynolds=[1.0, 20.0, 100.0]),
]
STUDIES = {
    "flow": Study([Table(flows, flow_error, FLOW, tiny="all")]),
    "gradients": Study([Table(SOURCES, gradient_error, GRADIENTS, tiny="all")]),
    "precision": Study(
        [
            Table(ELLIPSES, single_precision, PRECISION),
            Table(SPHEROIDS, far_precision, FAR_PRECISION, key="far"),
        ]
    ),
    "march": Study([Table(cases(reynolds=[20.0, 40.0, 100.0]), marched)], march_text),
}
