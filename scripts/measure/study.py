"""A study: its tables, each with its cases, the measurement of one case, and its columns."""

import dataclasses
import itertools
import math
import string
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from shapeopt.render.tables import markdown
from surrogate import Fidelity, InvalidInput, Scene

TINY = Fidelity("tiny", 8, 2.5, 4, 4, 5)  # of tiny runs: every part of a flow, in seconds
SCALES = {"first": slice(1), "last": slice(-1, None), "all": slice(None)}
PLAIN = str | int | float | None | Mapping | list | tuple | np.ndarray | np.generic | Fidelity
Row = dict[str, Any]
Result = dict[str, Any]
Show = Callable[[Sequence[Row]], str]


class Unavailable(InvalidInput):
    """Raised where an optional package that a measurement needs is not installed."""


@dataclasses.dataclass(frozen=True, eq=False)  # hashed by identity
class Run:
    """How a study is run: tiny or whole, with which options, and where its progress is shown.

    A tiny run takes seconds, for tests; its numbers mean nothing.
    """

    tiny: bool = False
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    progress: Callable[[float, str], None] = lambda done, state: None

    def pick(self, tiny: Any, whole: Any) -> Any:
        """Return the value for the scale of this run."""
        return tiny if self.tiny else whole

    def fidelity(self, name: str, dimension: int = 2) -> Fidelity:
        """Return the named fidelity, or the tiny one in a tiny run."""
        return TINY if self.tiny else Scene(dimension=dimension, fidelity=name).fidelity


@dataclasses.dataclass(frozen=True)
class Table:
    """A table of rows that are measured in the same way.

    Args:
      cases: The cases, or a function of the run that returns them. A case is a dict.
      measure: ``measure(run, **case)`` returns the measured values of one case, or a list of
        such dicts. A row is the case and what was measured.
      show: Markdown of the rows; see ``columns`` and ``maps``. By default none.
      key: Name of the rows in the study's result.
      tiny: Which of the cases a tiny run measures: the "first", the "last" or "all".
    """

    cases: Callable[[Run], Iterable[Row]] | Sequence[Row]
    measure: Callable[..., Row | list[Row]]
    show: Show = lambda rows: ""
    key: str = "rows"
    tiny: str = "first"

    def chosen(self, run: Run) -> list[Row]:
        """Return the cases that this run measures."""
        found = self.cases(run) if callable(self.cases) else self.cases
        return list(found)[SCALES[self.tiny if run.tiny else "all"]]

    def rows(self, run: Run, case: Row) -> list[Row]:
        """Measure one case and return its rows; values that JSON cannot hold are left out."""
        found = self.measure(run, **case)
        kept = {name: value for name, value in case.items() if isinstance(value, PLAIN)}
        return [plain(kept | row) for row in (found if isinstance(found, list) else [found])]


@dataclasses.dataclass(frozen=True)
class Study:
    """A study: tables that one command measures, their text and their picture.

    Args:
      tables: The tables, in the order in which they are measured and shown.
      text: Markdown that follows the tables, or its form to be filled with the result.
      extra: ``extra(run, result)`` returns values of the result besides the tables.
      draw: ``draw(result, path)`` draws the picture of the study.
      options: Flags of the command, with argparse's settings.
    """

    tables: Sequence[Table]
    text: Callable[[Result], str] | str = ""
    extra: Callable[[Run, Result], Result] = lambda run, result: {}
    draw: Callable[[Result, Path], Any] | None = None
    options: Mapping[str, dict[str, Any]] = dataclasses.field(default_factory=dict)

    def markdown(self, result: Result) -> str:
        """Return all tables, the text, and which package is not installed, as Markdown."""
        text = words(self.text, **result) if isinstance(self.text, str) else self.text(result)
        parts = [table.show(result[table.key]) for table in self.tables if result.get(table.key)]
        return "\n\n".join(filter(None, [*parts, text, result.get("unavailable", "")]))


def cases(**axes: Iterable[Any]) -> list[Row]:
    """Return all combinations of the values, the last varying fastest."""
    return [dict(zip(axes, point, strict=True)) for point in itertools.product(*axes.values())]


def columns(text: str) -> Show:
    """Return a function that shows rows as a table of columns "head {format} | head {format}"."""
    cut = [(part[: part.index("{")].strip(), part[part.index("{") :]) for part in text.split("|")]
    heads = [head for head, _ in cut]
    return lambda rows: markdown(
        heads, [[words(form.strip(), **row) for _, form in cut] for row in rows]
    )


def maps(cell: Callable[[Row], str]) -> Show:
    """Return a function that shows rows as one table per ``panel``, with ``cell(row)`` in it.

    A row's place is where its "row" and "column" cross.
    """

    def show(rows: Sequence[Row]) -> str:
        parts = []
        for panel in values(rows, "panel"):
            mine = [row for row in rows if row["panel"] == panel]
            cells = {(row["row"], row["column"]): cell(row) for row in mine}
            heads = values(mine, "column")
            lines = [[y, *(cells.get((y, x), "") for x in heads)] for y in values(mine, "row")]
            parts.append(markdown([panel, *heads], lines))
        return "\n\n".join(parts)

    return show


def panel(name: str, row: str, column: str, found: Iterable[Row]) -> list[Row]:
    """Return the cases with their places in ``maps``, whose forms are filled with the case.

    Args:
      name: Form of the panel's name.
      row: Form of the row's name.
      column: Form of the column's name.
      found: The cases.
    """
    return [x | place(words(name, **x), words(row, **x), words(column, **x)) for x in found]


def place(panel: str, row: str, column: str) -> Row:
    """Return where a row stands in ``maps``, as entries of the row."""
    return {"panel": panel, "row": row, "column": column}


def values(rows: Iterable[Row], key: str) -> list[Any]:
    """Return the different values of ``key`` in the rows, in order of appearance."""
    return list(dict.fromkeys(row[key] for row in rows))


class _Words(string.Formatter):
    def get_value(self, key, arguments, named):
        return named.get(key)

    def format_field(self, value, spec):
        if value is None:
            return "-"
        return f"{100 * value:{spec[:-1]}f} %" if spec.endswith("%") else format(value, spec)


def words(form: str, **named: Any) -> str:
    """Return ``form`` filled in; a missing value is a dash, and a per cent sign follows a space."""
    return _Words().vformat(form, (), named)


def plain(value: Any) -> Any:
    """Return the value as JSON holds it: infinities and NaN are None, a fidelity is its name."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic | jax.Array):
        return plain(value.tolist())
    if isinstance(value, Fidelity):
        return value.name
    return None if isinstance(value, float) and not math.isfinite(value) else value
