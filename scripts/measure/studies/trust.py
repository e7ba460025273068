"""How often the estimated error covers the error, and the status misleads: random bodies."""

import math
from collections.abc import Iterable, Iterator, Sequence

import jax
import numpy as np
from scipy.stats import qmc
from studies.accuracy_3d import BETAS as BETAS_3D
from study import TINY, Result, Row, Run, Study, Table, columns, values
from tools import SILENT

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
from surrogate.flow.check.error_estimate import SAFETY
from surrogate.scene.fidelity import SPACE_FIDELITIES

KINDS = ("symmetric", "incidence", "general", "tunnel")
ASPECT, REYNOLDS = (0.4, 6.0), (0.25, 60.0)  # the error tolerance is for 0.5 to 5 and 0.5 to 45
BETAS = {"beta2": 0.3, "beta3": 0.2, "beta4": 0.12}  # at most
INCIDENCE = 15.0  # degrees, at most
TUNNELS = (4.0, 8.0, 16.0)
WAVES = np.arange(2, 6)  # of a general body's radius
WAVY = 0.3  # amplitude of wave k, at most, times k
SECTION = ("0012", 5.0, (40.0, 100.0))  # NACA code, incidence, Re
ASPECT_3D, REYNOLDS_3D = (0.45, 4.4), (0.08, 120.0)  # the tolerance is for 0.5 to 4, 0.1 to 100
FAMILIES = {
    "of revolution": Family(dimension=3, aspect=ASPECT_3D, **BETAS_3D),
    "flattened": Family(dimension=3, aspect=ASPECT_3D, flatness=(1.0, 2.0), **BETAS_3D),
}
COUNTS_3D = {"draft": 8, "standard": 3}  # bodies of each kind


def bodies(run: Run) -> list[Row]:
    """Random bodies, sorted so that grids that are compiled for one serve others."""
    found = random_bodies(run.pick(4, run.options["count"]), run.options["seed"])
    return sorted(found, key=lambda case: (case["stream"], case["shape"].extent.round(1).tolist()))


def random_bodies(count: int, seed: int) -> Iterator[Row]:
    """As many of every kind: Re and aspect evenly in their logarithms, the rest evenly."""
    draws = qmc.Sobol(2 + 2 * len(WAVES) + 1, rng=seed).random_base2(math.ceil(math.log2(count)))
    for k, (re, aspect, choice, *rest) in enumerate(draws[:count]):
        reynolds = float(REYNOLDS[0] * (REYNOLDS[1] / REYNOLDS[0]) ** re)
        aspect, signs = ASPECT[0] * (ASPECT[1] / ASPECT[0]) ** aspect, 2 * np.array(rest) - 1
        kind, stream = KINDS[k * len(KINDS) // count], "unbounded"
        if kind == "general":
            shape = contour_shape(wavy(aspect, *signs.reshape(2, -1)))
        else:
            turn = INCIDENCE * (2 * choice - 1) if kind == "incidence" else 0.0
            shape = valid(aspect, signs[: len(BETAS)] * [*BETAS.values()], turn)
        if kind == "tunnel":
            stream = f"tunnel:{TUNNELS[int(choice * len(TUNNELS))]:g}"
        yield {"kind": kind, "reynolds": reynolds, "stream": stream, "shape": shape}


def valid(aspect: float, betas: np.ndarray, turn: float) -> Shape:
    """A body of the family, its betas halved until it does not cross itself."""
    try:
        return family_shape({"aspect": aspect} | dict(zip(BETAS, betas, strict=True)), turn)
    except InvalidInput:
        return valid(aspect, betas / 2, turn)


def wavy(aspect: float, cosines: np.ndarray, sines: np.ndarray) -> np.ndarray:
    """A lopsided smooth contour: an ellipse whose radius is multiplied by a random wave."""
    t = 2 * np.pi * np.arange(200) / 200
    size = WAVY / WAVES / len(WAVES)
    radius = 1 + (size * cosines) @ np.cos(np.outer(WAVES, t))
    radius += (size * sines) @ np.sin(np.outer(WAVES, t))
    return (radius * [aspect**0.5 * np.cos(t), aspect**-0.5 * np.sin(t)]).T


def sections(run: Run) -> list[Row]:
    """A known section at incidence."""
    code, turn, numbers = SECTION
    case = {"kind": f"NACA {code} at {turn:g} degrees", "shape": contour_shape(naca4(code), turn)}
    return [case | {"reynolds": re, "stream": "unbounded"} for re in numbers]


def estimate(run: Run, kind: str, shape: Shape, reynolds: float, stream: str) -> Row:
    """Standard with its estimate against fine; a tiny run has draft for both."""
    pair = [FIDELITIES[name] for name in run.pick(("draft", "draft"), ("standard", "fine"))]
    return compared(shape, reynolds, stream, *pair)


def bodies_3d(run: Run) -> Iterator[Row]:
    """As many of both kinds, Re spread evenly in its logarithm."""
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
    """Draft against standard, standard against what fine flows tend to."""
    draft, standard, fine = SPACE_FIDELITIES.values()
    pair = run.pick((TINY, TINY), (draft, standard) if fidelity == "draft" else (standard, fine))
    return compared(shape, reynolds, stream, *pair, extrapolated=fidelity == "standard")


def compared(
    shape: Shape,
    reynolds: float,
    stream: str,
    level: Fidelity,
    finer: Fidelity,
    extrapolated: bool = False,
) -> Row:
    """What a flow says of its error, and its error against a finer one, or its extrapolation."""
    row = {"parameters": shape.parameters, "reach": shape.extent, "promise": level.promise}
    try:
        coarse, fine = (
            Flow(Scene(stream, dimension=shape.dimension, fidelity=fidelity))
            for fidelity in (level, finer)
        )
        found = coarse.solve(shape, reynolds, allow_unsteady=True)
        truth = fine.solve(shape, reynolds, estimate=extrapolated, allow_unsteady=True)
    except (InvalidInput, NotConverged) as error:
        return row | {"status": type(error).__name__}
    return row | {
        "status": found.status,
        "drag": found.drag,
        "likely": _likely(found.estimated_error),
        "error": abs(found.drag / (truth.extrapolated_drag or truth.drag) - 1),
        "lift": found.lift,
        "lift_likely": _likely(found.estimated_lift_error),
        "lift_error": abs(found.lift - truth.lift),
        "sufficient": found.sufficient,
    }


def _likely(estimate: float | None) -> float | None:
    """The estimate without its safety factor."""
    return None if estimate is None else estimate / SAFETY


def rows_of(result: Result) -> list[Row]:
    """All rows with their error tolerance; older records have one for all rows, or for parts."""
    return [
        {name: part.get(name) for name in ("promise", "fidelity")} | row
        for part in result.get("parts", [result])
        for row in part["rows"]
    ]


def summary(rows: Sequence[Row], kinds: Iterable[str]) -> Iterator[Row]:
    """How often the estimate covers the error and the status misleads, by kind and of all."""
    for kind in (*kinds, "all"):
        mine = [row for row in rows if kind in (row["kind"], "all")]
        judged = [row for row in mine if row.get("likely") is not None]
        accurate = [row for row in judged if row["status"] == "accurate"]
        ratios = [SAFETY * row["likely"] / max(row["error"], 1e-9) for row in judged]
        yield {
            "kind": kind,
            "cases": len(mine),
            "judged": len(judged),
            "covered": _share([ratio >= 1 for ratio in ratios]),
            "ratio": np.median(ratios) if ratios else None,
            "accurate": len(accurate),
            "most": max((row["error"] for row in accurate), default=None),
            "silent": sum(row["error"] > SILENT * row["promise"] for row in accurate),
            "lift_covered": _share(
                [r["lift_likely"] * SAFETY >= r["lift_error"] for r in judged if r["lift"]]
            ),
        }


def _share(held: Sequence[bool]) -> float | None:
    return sum(held) / len(held) if held else None


def text(result: Result) -> str:
    """The summary over kinds of bodies, and the section."""
    form = columns(f"{SUMMARY} | estimated error of Cl covers its error {{lift_covered:.1%}}")
    return f"{form(list(summary(rows_of(result), KINDS)))}\n\n{SECTIONS(result['sections'])}"


def text_3d(result: Result) -> str:
    """The summary over fidelities and kinds of bodies."""
    rows, lines = rows_of(result), []
    for name in values(rows, "fidelity"):
        mine = summary([row for row in rows if row["fidelity"] == name], FAMILIES)
        lines += [row | {"fidelity": name} for row in mine]
    return columns(f"fidelity {{fidelity}} | {SUMMARY}")(lines)


SUMMARY = (
    "kind {kind} | bodies {cases} | with an estimate {judged} | covers the error {covered:.1%}"
    " | median estimate over error {ratio:.2f} | called accurate {accurate}"
    " | largest error of these {most:.2%} | above twice the tolerance {silent}"
)
SECTIONS = columns(
    "section {kind} | Re {reynolds:g} | Cd {drag:.4f} | likely error {likely:.2%}"
    " | error {error:.2%} | Cl {lift:.4f} | likely error {lift_likely:.4f}"
    " | error {lift_error:.4f} | status {status} | sufficient fidelity {sufficient}"
)
SEED = {"--seed": {"type": int, "default": 0, "help": "of the bodies"}}
COUNT = {"--count": {"type": int, "default": 208, "help": "bodies"}}
TABLES = [Table(bodies, estimate, tiny="all"), Table(sections, estimate, key="sections")]
STUDIES = {
    "trust": Study(TABLES, text, options=COUNT | SEED),
    "trust_space": Study([Table(bodies_3d, estimate_3d, tiny="all")], text_3d, options=SEED),
}
