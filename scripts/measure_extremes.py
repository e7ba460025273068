"""Where the flow solver holds and where it says that it does not: a map over Re and aspect.

python scripts/measure_extremes.py --out out/extremes
"""

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import matplotlib
from common import Parser, emit, markdown, progress_bar, run

from surrogate.body import ellipse
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import whole_file
from surrogate.flow.drag import body_domain, family_body, solve_with_continuation
from surrogate.scene import FIDELITIES, Unbounded

matplotlib.use("Agg")
import matplotlib.pyplot as plt

REYNOLDS = (1e-3, 1e-2, 0.1, 1.0, 10.0, 40.0, 100.0, 200.0, 300.0)
ASPECTS = (0.2, 0.5, 1.0, 2.0, 4.0, 7.0, 10.0)
OUTCOMES = {"accurate": "#4c9f70", "degraded": "#f2b134", "not converged": "#c8553d"}
OUTCOMES |= {"refused": "#8d99ae", "no reference": "#d9d9d9"}
ACCURATE = 0.015


@dataclasses.dataclass(frozen=True)
class Cell:
    """One solve: its outcome, and its error against the fine grid where both are known."""

    fidelity: str
    aspect: float
    reynolds: float
    outcome: str
    cd: float | None
    error: float | None


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Solve every combination, compare with the fine grid, draw the map."""
    arguments = _parser().parse_args(argv)
    out = Path(arguments.out)
    cells: list[Cell] = []
    with progress_bar("extremes") as progress:
        for k, aspect in enumerate(ASPECTS):
            solved = {name: [_solve(name, aspect, re) for re in REYNOLDS] for name in FIDELITIES}
            for name in ("draft", "standard"):
                triples = zip(REYNOLDS, solved[name], solved["fine"], strict=True)
                cells += [_cell(name, aspect, *triple) for triple in triples]
            progress((k + 1) / len(ASPECTS), f"aspect {aspect:g}")
    picture = _draw(cells, out / "extremes.png")
    result = {"cells": [dataclasses.asdict(cell) for cell in cells], "picture": str(picture)}
    with whole_file(out / "extremes.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, _text(cells))


def _solve(fidelity: str, aspect: float, reynolds: float) -> float | str:
    """Cd, or the word for why there is none."""
    parameters = ellipse(aspect)
    try:
        domain = body_domain(
            Unbounded(), FIDELITIES[fidelity], family_body(parameters, 600), symmetric=True
        )
        markers = jnp.asarray(family_body(parameters, domain.nodes))
        return float(solve_with_continuation(domain, markers, reynolds).coefficients.drag)
    except InvalidInput:
        return "refused"
    except NotConverged:
        return "not converged"


def _cell(fidelity, aspect, reynolds, found, reference) -> Cell:
    if isinstance(found, str):
        return Cell(fidelity, aspect, reynolds, found, None, None)
    if isinstance(reference, str):
        return Cell(fidelity, aspect, reynolds, "no reference", found, None)
    error = found / reference - 1
    outcome = "accurate" if abs(error) <= ACCURATE else "degraded"
    return Cell(fidelity, aspect, reynolds, outcome, found, error)


def _draw(cells: list[Cell], path: Path) -> Path:
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.2), layout="constrained", sharey=True)
    for axis, name in zip(axes, ("draft", "standard"), strict=True):
        for cell in (cell for cell in cells if cell.fidelity == name):
            i, j = REYNOLDS.index(cell.reynolds), ASPECTS.index(cell.aspect)
            axis.add_patch(plt.Rectangle((i - 0.5, j - 0.5), 1, 1, color=OUTCOMES[cell.outcome]))
            if cell.error is not None:
                axis.text(i, j, f"{100 * cell.error:+.1f} %", ha="center", va="center", fontsize=7)
        axis.set(xlim=(-0.5, len(REYNOLDS) - 0.5), ylim=(-0.5, len(ASPECTS) - 0.5), title=name)
        axis.set_xticks(range(len(REYNOLDS)), [f"{re:g}" for re in REYNOLDS])
        axis.set_yticks(range(len(ASPECTS)), [f"{aspect:g}" for aspect in ASPECTS])
        axis.set(xlabel="Reynolds number", ylabel="aspect")
    handles = [plt.Rectangle((0, 0), 1, 1, color=colour) for colour in OUTCOMES.values()]
    figure.legend(handles, OUTCOMES, loc="outside lower center", ncols=5, frameon=False)
    with whole_file(path) as part:
        figure.savefig(part, dpi=130)
    plt.close(figure)
    return path


def _text(cells: list[Cell]) -> str:
    rows = []
    for name in ("draft", "standard"):
        for aspect in ASPECTS:
            chosen = [c for c in cells if (c.fidelity, c.aspect) == (name, aspect)]
            words = [c.outcome if c.error is None else f"{100 * c.error:+.2f} %" for c in chosen]
            rows.append([f"{name}, aspect {aspect:g}", *words])
    return markdown(["error against the fine grid", *(f"Re {re:g}" for re in REYNOLDS)], rows)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", required=True, help="folder of extremes.json and extremes.png")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
