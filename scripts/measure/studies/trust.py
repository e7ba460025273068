"""How often the bound covers the error, how tight it is, and whether the status misleads.

Random bodies. The true drag of symmetric bodies in an unbounded stream is by finite elements, that
of all others by the fine grid.
"""

import contextlib
import functools
from collections.abc import Iterator
from unittest import mock

import jax
import numpy as np
from elements import unbounded_cd
from error_bounds import lift_and_moment, summary
from random_bodies import random_bodies
from studies.accuracy_3d import BETAS as BETAS_3D
from study import TINY, Result, Row, Run, Study, Table, columns, values

from surrogate import (
    FIDELITIES,
    Family,
    Fidelity,
    Flow,
    InvalidInput,
    NotConverged,
    Scene,
    Shape,
    contour_shape,
    family_shape,
    naca4,
)
from surrogate.flow.check.error_model import ERROR_MODELS, Loads
from surrogate.scene.fidelity import NAMED

SCENE = "symmetric, on a scene's grid"  # which is larger than one for the body alone
SECTION = ("0012", 5.0, (40.0, 100.0))  # NACA code, incidence, Re
ASPECT_3D, REYNOLDS_3D = (0.45, 4.4), (0.08, 120.0)  # the tolerance is for 0.5 to 4, 0.1 to 100
FAMILIES = {
    "of revolution": Family(dimension=3, aspect=ASPECT_3D, **BETAS_3D),
    "flattened": Family(dimension=3, aspect=ASPECT_3D, flatness=(1.0, 2.0), **BETAS_3D),
}
COUNTS_3D = {"draft": 8, "standard": 3}  # bodies of each kind


def bodies(run: Run) -> list[Row]:
    """Return random bodies, sorted so that grids that are compiled for one serve others."""
    found = list(random_bodies(run.pick(4, run.options["count"]), run.options["seed"]))
    found += [case | {"kind": SCENE} for case in found if _in_scene(case)]
    return sorted(found, key=lambda case: (case["stream"], case["shape"].extent.round(1).tolist()))


def _in_scene(case: Row) -> bool:
    """Whether a symmetric body and its Re may be of the usual scene; the flow refuses the rest."""
    low, high = Scene().reynolds
    return case["kind"] == "symmetric" and low <= case["reynolds"] <= high


def sections(run: Run) -> list[Row]:
    """Return the cases: a known section at incidence."""
    code, turn, numbers = SECTION
    case = {"kind": f"NACA {code} at {turn:g} degrees", "shape": contour_shape(naca4(code), turn)}
    return [case | {"reynolds": re, "stream": "unbounded"} for re in numbers]


def estimate(run: Run, kind: str, shape: Shape, reynolds: float, stream: str) -> Row:
    """Return the estimate of the standard fidelity beside its error against elements or fine.

    A tiny run has draft for all.

    Args:
      run: How the study is run.
      kind: Of the body.
      shape: The body.
      reynolds: U D / nu.
      stream: As for ``parse_stream``.
    """
    pair = [FIDELITIES[name] for name in run.pick(("draft", "draft"), ("standard", "fine"))]
    exact = None
    if kind in ("symmetric", SCENE) and not run.tiny:
        exact = _by_elements(tuple(shape.parameters.items()), reynolds)
    return compared(shape, reynolds, stream, *pair, exact=exact, in_scene=kind == SCENE)


@functools.cache
def _by_elements(body: tuple, reynolds: float) -> float:
    return unbounded_cd(dict(body), reynolds)


def bodies_3d(run: Run) -> Iterator[Row]:
    """Yield as many bodies of both kinds, Re spread evenly in its logarithm."""
    for name, count in COUNTS_3D.items():
        for part, (kind, family) in enumerate(FAMILIES.items()):
            keys = jax.random.split(jax.random.key(run.options["seed"] + part))
            samples = family.sample(keys[0], run.pick(1, count))
            numbers = jax.random.permutation(keys[1], np.geomspace(*REYNOLDS_3D, len(samples)))
            for body, re in zip(samples, numbers, strict=True):
                shape = family_shape(family.named(np.asarray(body)), dimension=3)
                row = {"fidelity": name, "kind": kind, "reynolds": float(re)}
                yield row | {"stream": "unbounded", "shape": shape}


def estimate_3d(run, fidelity, reynolds, stream, shape, **_) -> Row:
    """Return the estimate of draft beside its error against standard, or of standard against fine.

    The error of standard is against the extrapolation of the fine flow.

    Args:
      run: How the study is run.
      fidelity: Its name.
      reynolds: U D / nu.
      stream: As for ``parse_stream``.
      shape: The body.
      **_: The rest of the case.
    """
    draft, standard, fine = NAMED[3].values()
    pair = run.pick((TINY, TINY), (draft, standard) if fidelity == "draft" else (standard, fine))
    return compared(shape, reynolds, stream, *pair, extrapolated=fidelity == "standard")


def compared(
    shape: Shape,
    reynolds: float,
    stream: str,
    level: Fidelity,
    finer: Fidelity,
    extrapolated: bool = False,
    exact: float | None = None,
    in_scene: bool = False,
) -> Row:
    """Return what a flow says of its error, and its error.

    The error is against an exact drag, a finer flow, or the extrapolation of a finer flow.

    Args:
      shape: The body.
      reynolds: U D / nu.
      stream: As for ``parse_stream``.
      level: Fidelity of the flow.
      finer: Fidelity of the flow that it is compared with.
      extrapolated: Whether that flow's extrapolated drag is taken.
      exact: Cd, if known.
      in_scene: Whether the body is solved on its scene's grid.
    """
    row = {"parameters": shape.parameters, "tolerance": level.tolerance}
    try:
        coarse, fine = (
            Flow(Scene(stream, dimension=shape.dimension, fidelity=fidelity))
            for fidelity in (level, finer)
        )
        body = [shape.parameters[n] for n in coarse.scene.family.names] if in_scene else shape
        with parts_of_errors(shape.dimension) as parts:
            found = coarse.solve(body, reynolds, allow_unsteady=True)
        truth, lift, moment = exact, found.lift, found.moment
        if exact is None:
            finest = fine.solve(shape, reynolds, estimate=extrapolated, allow_unsteady=True)
            truth = finest.extrapolated_drag or finest.drag
            lift, moment = finest.lift, finest.moment
    except InvalidInput:
        return row | {"status": "InvalidInput"}
    except NotConverged:
        return row | {"status": "NotConverged"}
    grid, domain = parts[0] if parts else (None, None)
    return row | {
        "status": found.status,
        "drag": found.drag,
        "grid": grid and grid.drag,
        "domain": domain and domain.drag,
        "expected": found.expected_error,
        "bound": found.estimated_error,
        "error": found.drag / truth - 1,
        "lift": found.lift,
        "lift_bound": found.estimated_lift_error,
        "lift_error": found.lift - lift,
        "moment_bound": found.estimated_moment_error,
        "moment_error": found.moment - moment,
        "sufficient": found.sufficient,
    }


@contextlib.contextmanager
def parts_of_errors(dimension: int) -> Iterator[list[tuple[Loads, Loads]]]:
    """Record the errors of grid and domain over Cd that estimates are made of."""
    kind, found = type(ERROR_MODELS[dimension]), []
    likely = kind.likely

    def recorded(model, grid, domain, *rest):
        found.append((grid, domain))
        return likely(model, grid, domain, *rest)

    with mock.patch.object(kind, "likely", recorded):
        yield found


def rows_of(result: Result) -> list[Row]:
    """Return all rows with their error tolerance, also of a record that has one for all rows."""
    common = {name: result.get(name) for name in ("tolerance", "fidelity")}
    return [common | row for row in result["rows"]]


def against_elements(result: Result) -> list[Row]:
    """Return the rows of ``trust`` whose error is against elements, each body once."""
    rows = [row for row in rows_of(result) if row["kind"] == "symmetric"]
    return [row for row in rows if row.get("error") is not None]


def text(result: Result) -> str:
    """Return the summary of Cd and that of Cl and Cm over kinds of bodies, and the section."""
    rows, sections = rows_of(result), rows_of({"rows": result["sections"]})
    drags = columns(SUMMARY)(list(summary(rows, values(rows, "kind"))))
    return f"{drags}\n\n{LIFTS(list(lift_and_moment(rows)))}\n\n{SECTIONS(sections)}"


def text_3d(result: Result) -> str:
    """Return the summary over fidelities and kinds of bodies as a table."""
    rows, lines = rows_of(result), []
    for name in values(rows, "fidelity"):
        mine = summary([row for row in rows if row["fidelity"] == name], FAMILIES)
        lines += [row | {"fidelity": name} for row in mine]
    return columns(f"fidelity {{fidelity}} | {SUMMARY}")(lines)


SUMMARY = (
    "kind {kind} | bodies {cases} | with an estimate {judged} | bound covers the error"
    " {covered:.1%} | median bound over error {ratio:.2f} | error within the tolerance {within}"
    " | of these called degraded {degraded} | called accurate {accurate} | of these over the"
    " tolerance {over} | largest error of these {most:.2%} | above twice the tolerance {silent}"
)
LIFTS = columns(
    "kind {kind} | load {load} | bodies {cases} | bound covers the error {covered:.1%}"
    " | median bound over error {ratio:.2f} | called accurate {accurate} | of these over the"
    " tolerance {over} | largest error of these, over Cd {most:.2%}"
)
SECTIONS = columns(
    "section {kind} | Re {reynolds:g} | Cd {drag:.4f} | expected error {expected:.2%}"
    " | bound {bound:.2%}"
    " | error {error:.2%} | Cl {lift:.4f} | bound {lift_bound:.4f}"
    " | error {lift_error:.4f} | status {status} | sufficient fidelity {sufficient}"
)
SEED = {"--seed": {"type": int, "default": 0, "help": "of the bodies"}}
SEED_2D = {"--seed": {"type": int, "default": 1, "help": "of the bodies; constants fit seed 0"}}
COUNT = {"--count": {"type": int, "default": 208, "help": "bodies"}}
TABLES = [Table(bodies, estimate, tiny="all"), Table(sections, estimate, key="sections")]
STUDIES = {
    "trust": Study(TABLES, text, options=COUNT | SEED_2D),
    "trust_space": Study([Table(bodies_3d, estimate_3d, tiny="all")], text_3d, options=SEED),
}
