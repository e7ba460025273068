"""Many flows past one body, at several incidences and Reynolds numbers: solved, as a table."""

import argparse
import csv
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from shapeopt.commands.arguments import SINGLE_VALUED, family_named
from shapeopt.commands.cli import Parser
from shapeopt.commands.reference import DIAMETER, reference_record
from surrogate.body.contour import naca_digits
from surrogate.body.shape import Shape
from surrogate.errors import NotConverged
from surrogate.files import JsonObject, check_file, whole_file
from surrogate.progress import progress_bar

COLUMNS = {  # of the text: key in a row, head and format
    "incidence": ("incidence", "g"),
    "reynolds": ("Re", ".4g"),
    "chord_reynolds": ("chord Re", ".4g"),
    "cd": ("Cd", ".4f"),
    "cd_pressure": ("pressure", ".4f"),
    "cd_friction": ("friction", ".4f"),
    "cl": ("Cl", ".4f"),
    "estimated_lift_error": ("Cl bound", ".4f"),
    "cm": ("Cm", ".4f"),
    "estimated_moment_error": ("Cm bound", ".4f"),
    "cm_about": ("Cm about", ".4f"),
    "glide": ("Cl/Cd", ".3f"),
    "expected_error": ("expected error", ".2%"),
    "estimated_error": ("bound", ".2%"),
    "status": ("status", ""),
    "sufficient": ("sufficient fidelity", ""),
}


class Case(NamedTuple):
    """A flow to be solved: a body at an incidence in degrees and at Re = U D / nu.

    ``reference`` names the reference length of its coefficients, the diameter D or the chord.
    """

    shape: Shape
    incidence: float
    reynolds: float
    reference: str = DIAMETER

    @property
    def record(self) -> JsonObject:
        """Incidence, Reynolds numbers, chord and reference length as entries of a row."""
        return {"incidence": self.incidence} | reference_record(
            self.reynolds, self.shape, self.reference
        )

    def __str__(self) -> str:
        turned = f", incidence {self.incidence:g}" if self.incidence else ""
        return f"Re {self.reynolds:.4g}{turned}"


def solve_cases(
    cases: Sequence[Case],
    solve: Callable[[Case], JsonObject],
    table: str | Path | None = None,
) -> list[JsonObject]:
    """Return one row of results for each case, without numbers where the flow does not converge.

    Args:
      cases: to be solved in this order, with a progress bar.
      solve: returns the row of a case.
      table: CSV file of the rows so far, written after each, so that an interruption loses none.

    Raises:
      NotConverged: no flow converged.
    """
    rows, failures = [], []
    with progress_bar("body flow") as progress:
        for k, case in enumerate(cases):
            try:
                rows.append(solve(case))
                state = f"Cd {rows[-1]['cd']:.4f}"
                if table is not None:
                    write_table([row for row in rows if row], table)
            except NotConverged as error:
                rows.append({})
                failures.append(error)
                state = "did not converge"
            progress((k + 1) / len(cases), f"{case}: {state}")
    if len(failures) == len(cases):
        raise failures[0]
    empty = dict.fromkeys(next(row for row in rows if row))
    empty |= {"converged": False, "status": "not converged"}
    return [row or empty | case.record for case, row in zip(cases, rows, strict=True)]


def check_converged(rows: Sequence[JsonObject]) -> None:
    """Raise NotConverged if a flow did not converge, naming all that did not."""
    if missing := [row for row in rows if not row["converged"]]:
        words = (f"incidence {row['incidence']:g} at Re {row['reynolds']:.4g}" for row in missing)
        raise NotConverged(
            f"{len(missing)} of {len(rows)} flows did not converge: {'; '.join(words)}"
        )


def text_table(rows: Sequence[JsonObject]) -> str:
    """Return rows of results as a text table with aligned columns.

    Columns without any value are left out; a missing value is shown as a dash.
    """
    columns = {k: c for k, c in COLUMNS.items() if any(row.get(k) is not None for row in rows)}
    lines = [[head for head, _ in columns.values()]]
    for row in rows:
        cells = ((row.get(key), form) for key, (_, form) in columns.items())
        lines.append([_cell(value, form) for value, form in cells])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
        for line in lines
    )


def _cell(value: object, form: str) -> str:
    """Return a value as text; missing as a dash, what is rounded to zero without a minus."""
    if value is None:
        return "-"
    text = format(value, form)
    return text.lstrip("-") if re.fullmatch(r"-0\.0*%?", text) else text


def add_sweep_arguments(parser: Parser) -> None:
    """Add the options of files that show all flows: --table and --plot."""
    parser.add_argument("--table", help="CSV file of the results, one row for each flow")
    parser.add_argument("--plot", help="picture of the polar, .png, .svg or .pdf")


def polar_title(arguments: argparse.Namespace, row: JsonObject) -> str:
    """Return what a plot shows: the body, its chord, and the reference of the coefficients."""
    name = Path(getattr(arguments, "contour", None) or "").stem
    if getattr(arguments, "naca", None):
        name = f"NACA {naca_digits(arguments.naca)}"
    if arguments.aspect is not None:
        given = {n: v for n, v in family_named(arguments, SINGLE_VALUED).items() if v}
        name = ", ".join(f"{n} {v:g}" for n, v in given.items())
    by = f"coefficients by the {row['reference']}, bars: 95 % error bounds where known"
    return f"{name}: chord {row['chord']:.3f} D, {by}"


def check_outputs(table: str | None, plot: str | None) -> None:
    """Raise InvalidInput unless the files of --table and --plot, where given, can be written."""
    if table:
        check_file(table, ".csv")
    if plot:
        check_file(plot, ".png", ".svg", ".pdf")


def write_table(rows: Sequence[JsonObject], path: str | Path) -> None:
    """Write rows as CSV with one column for each key; None becomes an empty cell.

    The columns of a nested table are named 'name.key', and are empty in a row with None for it. A
    list of words is one cell, separated by blanks.
    """
    flat = [dict(_flat(row)) for row in rows]
    names = list(dict.fromkeys(itertools.chain.from_iterable(flat)))
    names = [one for one in names if not any(other.startswith(f"{one}.") for other in names)]
    with whole_file(path) as part, part.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, restval="", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(flat)


def _flat(row: JsonObject, prefix: str = "") -> Iterator[tuple[str, object]]:
    """Yield keys and values, those of nested tables with the names of these."""
    for key, value in row.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", " ".join(value) if isinstance(value, list) else value
