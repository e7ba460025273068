"""How often the estimated error covers the error, and an accurate drag is not: random bodies.

python scripts/measure/trust.py
"""

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from scipy.stats import qmc
from study import Result, Study, run_study, table

from surrogate import (
    FIDELITIES,
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

KINDS = ("symmetric", "incidence", "general", "tunnel")
ASPECT, REYNOLDS = (0.4, 6.0), (0.25, 60.0)  # the promise is for 0.5 to 5 and 0.5 to 45
BETAS = {"beta2": 0.3, "beta3": 0.2, "beta4": 0.12}  # at most
INCIDENCE = 15.0  # degrees, at most
TUNNELS = (4.0, 8.0, 16.0)
WAVES = np.arange(2, 6)  # of a general body's radius; of wave k up to WAVY / k
WAVY = 0.3
SILENT = 2.0  # times the promise: an error that a drag called accurate must not have
SECTION = ("0012", 5.0, (40.0, 100.0))  # NACA code, incidence, Re

FOUND = ("drag", "likely", "error", "lift", "lift_likely", "lift_error", "sufficient")
NONE = dict.fromkeys(FOUND)


class Case(NamedTuple):
    """A body in a stream, of one kind."""

    kind: str
    shape: Shape
    reynolds: float
    stream: str = "unbounded"


def cases(count: int, seed: int) -> Iterator[Case]:
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
        yield Case(kind, shape, reynolds, stream)


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


def measure(tiny: bool, progress: Callable, count: int, seed: int) -> Result:
    """Standard with its estimate, and fine, of every case and of a known section."""
    draft, standard, fine = FIDELITIES.values()
    levels = (draft, draft) if tiny else (standard, fine)
    chosen, rows = list(cases(4 if tiny else count, seed)), []
    chosen = sorted(chosen, key=lambda case: (case.stream, case.shape.extent.round(1).tolist()))
    for k, case in enumerate(chosen):
        progress(k / len(chosen), f"{case.kind}, Re {case.reynolds:.3g}")
        rows.append(compared(case, *levels))
        if k % 7 == 6:
            jax.clear_caches()  # Linux grants a process so many memory maps, and these add up
    code, turn, numbers = SECTION
    section = contour_shape(naca4(code), turn)
    sections = [
        compared(Case(f"NACA {code} at {turn:g} degrees", section, re), *levels)
        for re in numbers[: 1 if tiny else None]
    ]
    return {"promise": levels[0].promise, "rows": rows, "sections": sections}


def compared(
    case: Case, level: Fidelity, finer: Fidelity, extrapolated: bool = False
) -> dict[str, Any]:
    """What the flow says of itself, and how far it is from the finer one, or what that tends to."""
    row = {"kind": case.kind, "reynolds": case.reynolds, "stream": case.stream}
    row |= {"parameters": case.shape.parameters, "reach": case.shape.extent}
    at = case.shape, case.reynolds
    try:
        coarse, fine = (
            Flow(Scene(case.stream, dimension=case.shape.dimension, fidelity=fidelity))
            for fidelity in (level, finer)
        )
        found = coarse.solve(*at, allow_unsteady=True)
        truth = fine.solve(*at, estimate=extrapolated, allow_unsteady=True)
    except (InvalidInput, NotConverged) as error:
        return NONE | row | {"status": type(error).__name__}
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


def _likely(estimate):
    return None if estimate is None else estimate / SAFETY


def summary(result: Result, kinds: Sequence[str] = KINDS) -> Iterator[dict[str, Any]]:
    """Of every kind and of all: how often the estimate holds, and the status misleads."""
    for kind in (*kinds, "all"):
        rows = [row for row in result["rows"] if kind in (row["kind"], "all")]
        judged = [row for row in rows if row["likely"] is not None]
        accurate = [row["error"] for row in judged if row["status"] == "accurate"]
        lifted = [row for row in judged if row["lift"]]
        ratios = [SAFETY * row["likely"] / max(row["error"], 1e-9) for row in judged]
        yield {
            "kind": kind,
            "cases": len(rows),
            "judged": len(judged),
            "covered": _share(ratio >= 1 for ratio in ratios),
            "ratio": np.median(ratios) if ratios else None,
            "accurate": len(accurate),
            "most": max(accurate, default=None),
            "silent": sum(error > SILENT * result["promise"] for error in accurate),
            "lift_covered": _share(
                SAFETY * row["lift_likely"] >= row["lift_error"] for row in lifted
            ),
        }


def _share(held):
    held = list(held)
    return sum(held) / len(held) if held else None


HEADS = "kind | bodies | with an estimate | which covers the error | median estimate over error"
HEADS += " | called accurate | of which the worst is off by | twice the promise or more"
FORMS = "{kind} | {cases} | {judged} | {covered:.1%} | {ratio:.2f} | {accurate} | {most:.2%}"
FORMS += " | {silent}"
LIFT = " | lift's estimate covers its error", " | {lift_covered:.1%}"
SECTIONS = (
    "section | Re | Cd | likely error | error | Cl | likely error | error | status | would do",
    "{kind} | {reynolds:g} | {drag:.4f} | {likely:.2%} | {error:.2%} | {lift:.4f}"
    " | {lift_likely:.4f} | {lift_error:.4f} | {status} | {sufficient}",
)


def tables(result: Result) -> str:
    told = table(list(summary(result)), HEADS + LIFT[0], FORMS + LIFT[1])
    return f"{told}\n\n{table(result['sections'], *SECTIONS)}"


OPTIONS = {
    "--count": {"type": int, "default": 208, "help": "bodies"},
    "--seed": {"type": int, "default": 0, "help": "of the bodies"},
}
STUDY = Study("trust", measure, tables, options=OPTIONS)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
