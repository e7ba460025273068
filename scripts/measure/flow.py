"""Accuracy of the flow solver: against references, over its range, order in h, window effect.

python scripts/measure_flow.py --out out/flow --json
"""

import dataclasses
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from common import Parser, emit, markdown, progress_bar, run

from surrogate.body.family import ellipse, family_markers, family_shape
from surrogate.errors import NotConverged
from surrogate.files import whole_file
from surrogate.flow.grid.domain import make_domain
from surrogate.flow.flow import solve
from surrogate.flow.solver.steady import preparation_cost
from surrogate.flow.check.trust import solve_shape
from surrogate.scene.scene import FIDELITIES, Fidelity, Stream, Tunnel, Unbounded

# cylinder, body-fitted finite elements with the far field removed, uncertainty about 1e-4
UNBOUNDED = {1.0: 10.335, 5.0: 3.930, 10.0: 2.754, 20.0: 1.999, 40.0: 1.497}
TUNNELS = {
    16.0: {1.0: 13.743, 10.0: 3.072, 40.0: 1.625},
    8.0: {1.0: 18.412, 10.0: 3.548, 40.0: 1.841},
}
CYLINDER, SLENDER = (1.0, 0.0, 0.0, 0.0), (4.0, 0.2, 0.1, 0.05)


@dataclasses.dataclass(frozen=True)
class Row:
    """One measured drag; ``error`` is relative to ``reference``."""

    table: str
    case: str
    reynolds: float
    cd: float
    reference: float
    error: float
    green_applications: int
    seconds: float


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Measure four tables, print them, keep them as JSON."""
    arguments = _parser().parse_args(argv)
    with progress_bar("measuring the flow") as progress:
        rows = []
        for k, table in enumerate((_accuracy, _everywhere, _order, _windows)):
            progress(k / 4, table.__name__.strip("_"))
            rows += table()
        progress(1.0)
    result = {"rows": [dataclasses.asdict(row) for row in rows]}
    with whole_file(Path(arguments.out) / "flow.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, _text(rows))


def _accuracy() -> list[Row]:
    """Every fidelity against the references."""
    rows = []
    for name, fidelity in FIDELITIES.items():
        for reynolds, reference in UNBOUNDED.items():
            drag = _drag(Unbounded(), fidelity, CYLINDER, reynolds)
            rows.append(_row("accuracy", f"{name}, unbounded", reynolds, drag, reference))
        for height, references in TUNNELS.items():
            for reynolds, reference in references.items():
                drag = _drag(Tunnel(height), fidelity, CYLINDER, reynolds)
                rows.append(
                    _row("accuracy", f"{name}, tunnel {height:g}", reynolds, drag, reference)
                )
    return rows


def _everywhere() -> list[Row]:
    """Every fidelity over the range it is made for, against a still finer one."""
    finest = Fidelity("", 40, 10, 24, 16, wake=0.3)
    rows = []
    for aspect in (0.5, 1.0, 2.0, 5.0):
        shape = family_shape(ellipse(aspect))
        for reynolds in (0.5, 5.0, 45.0):
            exact = solve_shape(shape, Unbounded(), finest, reynolds).cd
            for name, fidelity in FIDELITIES.items():
                solve_shape(shape, Unbounded(), fidelity, reynolds)
                found = solve_shape(shape, Unbounded(), fidelity, reynolds)
                drag = found.cd, found.green_applications, found.wall_s
                rows.append(_row("range", f"{name}, aspect {aspect:g}", reynolds, drag, exact))
        jax.clear_caches()  # Linux grants a process so many memory maps, and these add up
    return sorted(rows, key=lambda row: list(FIDELITIES).index(row.case.split(",")[0]))


def _order() -> list[Row]:
    """Cells per D on one small window, against 40 cells of the same window."""
    rows = []
    for name, body in (("cylinder", CYLINDER), ("slender body", SLENDER)):
        for reynolds in (1.0, 10.0, 40.0):
            exact = _drag(Unbounded(), Fidelity("", 40, 3, 5, 5), body, reynolds)[0]
            for cells in (6, 8, 12, 16, 24):
                drag = _drag(Unbounded(), Fidelity("", cells, 3, 5, 5), body, reynolds)
                rows.append(_row("order", f"{name}, n = {cells}", reynolds, drag, exact))
    return rows


def _windows() -> list[Row]:
    """The window's effect at 10 cells per D, against the largest window."""
    rows, largest = [], Fidelity("", 10, 10, 24, 16)
    for reynolds in (1.0, 10.0, 40.0):
        exact = _drag(Unbounded(), largest, CYLINDER, reynolds)[0]
        for upstream, downstream, height in ((3, 5, 6), (4, 8, 8), (6, 12, 8), (8, 16, 12)):
            fidelity = Fidelity("", 10, upstream, downstream, height)
            drag = _drag(Unbounded(), fidelity, CYLINDER, reynolds)
            case = f"{upstream} + {downstream} by {height}"
            rows.append(_row("window", case, reynolds, drag, exact))
    return rows


def _drag(stream: Stream, fidelity: Fidelity, body, reynolds: float) -> tuple[float, int, float]:
    """Cd, applications of G, and seconds after compilation."""
    extent = (1.25, 1.25) if body == CYLINDER else (2.5, 1.25)
    domain = make_domain(stream, fidelity, extent, symmetric=True)
    markers, re = family_markers(jnp.array(body), domain.nodes), jnp.asarray(reynolds)
    jax.block_until_ready(solve(domain, markers, re))
    start = time.perf_counter()
    solution = jax.block_until_ready(solve(domain, markers, re))
    seconds = time.perf_counter() - start
    if not bool(solution.info.converged):
        raise NotConverged(f"flow at Re {reynolds:g}, {fidelity} was not found")
    products = int(solution.info.products) + preparation_cost(domain)
    return float(solution.coefficients.drag), products, seconds


def _row(table, case, reynolds, drag, reference) -> Row:
    cd, products, seconds = drag
    return Row(table, case, reynolds, cd, reference, cd / reference - 1, products, seconds)


def _text(rows: list[Row]) -> str:
    """Markdown tables: one line a case, one column a Reynolds number, errors in per cent."""
    parts = []
    for table in dict.fromkeys(row.table for row in rows):
        chosen = [row for row in rows if row.table == table]
        columns = sorted({row.reynolds for row in chosen})
        heads, lines = [table, *(f"Re {re:g}" for re in columns), "time of a solve"], []
        for case in dict.fromkeys(row.case for row in chosen):
            found = {row.reynolds: row for row in chosen if row.case == case}
            cells = [f"{100 * found[re].error:+.2f} %" if re in found else "" for re in columns]
            seconds = np.median([row.seconds for row in found.values()])
            lines.append([case, *cells, f"{1000 * seconds:.0f} ms"])
        parts.append(markdown(heads, lines))
    return "\n\n".join(parts)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", required=True, help="folder of flow.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
