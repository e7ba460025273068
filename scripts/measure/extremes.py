"""Where the flow solver holds, and where it says that it does not: maps of outcome and error.

python scripts/measure_extremes.py --out out/extremes
"""

import dataclasses
import functools
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import matplotlib
from common import Parser, emit, markdown, progress_bar, run

from surrogate.body.family import ellipse, family_shape
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import whole_file
from surrogate.flow.check.trust import judge, solve_shape
from surrogate.scene.scene import FIDELITIES, Fidelity, Stream, Tunnel, Unbounded

matplotlib.use("Agg")
import matplotlib.pyplot as plt

OUTCOMES = {"accurate": "#4c9f70", "degraded": "#f2b134", "not converged": "#c8553d"}
OUTCOMES |= {"refused": "#8d99ae", "silently wrong": "#000000"}
SILENT = 2.0  # times the promise: an error that a drag called accurate must not have


@dataclasses.dataclass(frozen=True)
class Flow:
    """One body flow to be tried."""

    aspect: float
    reynolds: float
    fidelity: Fidelity
    stream: Stream = Unbounded()


@dataclasses.dataclass(frozen=True)
class Cell:
    """What came of it: ``error`` against the fine grid, where that flow is found."""

    panel: str
    row: str
    column: str
    outcome: str
    cd: float | None
    estimated_error: float | None
    error: float | None


@dataclasses.dataclass(frozen=True)
class Panel:
    """One map: labels of rows and columns, and the flow of each field."""

    name: str
    rows: dict[str, Any]
    columns: dict[str, Any]
    flow: Callable[[Any, Any], Flow]


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Solve every combination, compare with the fine grid, draw the maps."""
    arguments = _parser().parse_args(argv)
    out = Path(arguments.out)
    panels = _panels()
    cells: list[Cell] = []
    with progress_bar("extremes") as progress:
        for k, panel in enumerate(panels):
            for j, (row, value) in enumerate(panel.rows.items()):
                progress((k + j / len(panel.rows)) / len(panels), f"{panel.name}, {row}")
                cells += [
                    _cell(panel.name, row, column, panel.flow(value, other))
                    for column, other in panel.columns.items()
                ]
                jax.clear_caches()  # Linux grants a process so many memory maps, and these add up
        progress(1.0)
    picture = _draw(panels, cells, out / "extremes.png")
    silent = sum(cell.outcome == "silently wrong" for cell in cells)
    result = {
        "cells": [dataclasses.asdict(cell) for cell in cells],
        "silently_wrong": silent,
        "picture": str(picture),
    }
    with whole_file(out / "extremes.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, _text(panels, cells))


def _panels() -> list[Panel]:
    standard = FIDELITIES["standard"]
    reynolds = {f"Re {re:g}": re for re in (1e-3, 0.1, 1.0, 10.0, 40.0, 100.0, 300.0)}
    aspects = {f"aspect {a:g}": a for a in (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)}
    maps = [
        Panel(name, aspects, reynolds, functools.partial(Flow, fidelity=FIDELITIES[name]))
        for name in ("draft", "standard")
    ]
    cells = {f"n = {n}": dataclasses.replace(standard, cells=n) for n in (4, 6, 8, 12, 16, 24, 32)}
    maps.append(Panel("cells per D, Re 10", cells, aspects, lambda f, a: Flow(a, 10.0, f)))
    windows = {
        f"{u} + {d} by {h}": dataclasses.replace(standard, upstream=u, downstream=d, height=h)
        for u, d, h in ((2.5, 2.5, 4), (3, 4, 5), (4, 8, 8), (6, 12, 8))
    }
    maps.append(Panel("window, cylinder", windows, reynolds, lambda f, re: Flow(1.0, re, f)))
    tunnels = {f"H = {h:g}": h for h in (1.5, 2.3, 3.0, 6.0, 100.0)}
    maps.append(
        Panel(
            "tunnel, cylinder",
            tunnels,
            reynolds,
            lambda h, re: Flow(1.0, re, standard, Tunnel(h)),
        )
    )
    return maps


def _cell(panel: str, row: str, column: str, flow: Flow) -> Cell:
    found = _drag(flow.aspect, flow.reynolds, flow.fidelity, flow.stream)
    if isinstance(found, str):
        return Cell(panel, row, column, found, None, None, None)
    shape = family_shape(ellipse(flow.aspect))
    trust = judge(found, shape, flow.stream, flow.fidelity, flow.reynolds)
    reference = _drag(flow.aspect, flow.reynolds, FIDELITIES["fine"], flow.stream)
    error = None if isinstance(reference, str) else found / reference - 1
    outcome: str = trust.status
    if outcome == "accurate" and abs(error or 0.0) > SILENT * flow.fidelity.promise:
        outcome = "silently wrong"
    return Cell(panel, row, column, outcome, found, trust.estimated_error, error)


@functools.cache
def _drag(aspect: float, reynolds: float, fidelity: Fidelity, stream: Stream) -> float | str:
    """Cd, or the word for why there is none."""
    try:
        return solve_shape(family_shape(ellipse(aspect)), stream, fidelity, reynolds).cd
    except InvalidInput:
        return "refused"
    except NotConverged:
        return "not converged"


def _draw(panels: list[Panel], cells: list[Cell], path: Path) -> Path:
    figure, axes = plt.subplots(3, 2, figsize=(12, 10.5), layout="constrained")
    for axis, panel in zip(axes.flat, panels, strict=False):
        rows, columns = list(panel.rows), list(panel.columns)
        for cell in (cell for cell in cells if cell.panel == panel.name):
            i, j = columns.index(cell.column), rows.index(cell.row)
            axis.add_patch(plt.Rectangle((i - 0.5, j - 0.5), 1, 1, color=OUTCOMES[cell.outcome]))
            if cell.error is not None:
                axis.text(i, j, f"{100 * cell.error:+.1f} %", ha="center", va="center", fontsize=7)
        axis.set(xlim=(-0.5, len(columns) - 0.5), ylim=(-0.5, len(rows) - 0.5), title=panel.name)
        axis.set_xticks(range(len(columns)), columns, fontsize=8)
        axis.set_yticks(range(len(rows)), rows, fontsize=8)
    axes.flat[-1].axis("off")
    handles = [plt.Rectangle((0, 0), 1, 1, color=colour) for colour in OUTCOMES.values()]
    axes.flat[-1].legend(handles, OUTCOMES, loc="center", frameon=False, title="status says")
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)
    plt.close(figure)
    return path


def _text(panels: list[Panel], cells: list[Cell]) -> str:
    """A table a panel: the error against the fine grid, in brackets where the status warns."""
    found = {(cell.panel, cell.row, cell.column): cell for cell in cells}
    tables = []
    for panel in panels:
        rows = [
            [row, *(_word(found[panel.name, row, column]) for column in panel.columns)]
            for row in panel.rows
        ]
        tables.append(markdown([panel.name, *panel.columns], rows))
    silent = sum(cell.outcome == "silently wrong" for cell in cells)
    return "\n\n".join([*tables, f"{silent} of {len(cells)} fields are silently wrong"])


def _word(cell: Cell) -> str:
    if cell.cd is None:
        return cell.outcome
    error = "no reference" if cell.error is None else f"{100 * cell.error:+.2f} %"
    return {"accurate": error, "degraded": f"({error})", "silently wrong": f"!! {error}"}[
        cell.outcome
    ]


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", required=True, help="folder of extremes.json and extremes.png")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
