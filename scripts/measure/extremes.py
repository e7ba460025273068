"""Where the flow solver holds, and where it says that it does not: maps of outcome and error.

python scripts/measure/extremes.py
"""

import dataclasses
import functools
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
from maps import Field, draw_maps, map_tables
from study import TINY, Result, Study, run_study, words

from surrogate import FIDELITIES, Fidelity, Flow, InvalidInput, NotConverged, Scene, family_shape

OUTCOMES = {"accurate": "#4c9f70", "degraded": "#f2b134", "not converged": "#e08e58"}
OUTCOMES |= {"refused": "#b8bec9", "silently wrong": "#d81b60"}
REYNOLDS = (1e-3, 0.1, 1.0, 10.0, 40.0, 100.0, 300.0)
SILENT = 2.0  # times the promise: an error that a drag called accurate must not have


class Case(NamedTuple):
    """One ellipse in one stream."""

    aspect: float
    reynolds: float
    fidelity: Fidelity
    stream: str = "unbounded"


def cases() -> Iterator[tuple[str, str, str, Case]]:
    """All fields: panel, row, column."""
    standard, aspects = FIDELITIES["standard"], (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
    for name in ("draft", "standard"):
        for a in aspects:
            for re in REYNOLDS:
                yield name, f"aspect {a:g}", f"Re {re:g}", Case(a, re, FIDELITIES[name])
    for n in (4, 6, 8, 12, 16, 24, 32):
        for a in aspects:
            case = Case(a, 10.0, dataclasses.replace(standard, cells=n))
            yield "cells per D, Re 10", f"n = {n}", f"aspect {a:g}", case
    for u, d, h in ((2.5, 2.5, 4), (3, 4, 5), (4, 8, 8), (6, 12, 8)):
        window = dataclasses.replace(standard, upstream=u, downstream=d, height=h)
        for re in REYNOLDS:
            yield "window, cylinder", f"{u} + {d} by {h}", f"Re {re:g}", Case(1.0, re, window)
    for h in (1.5, 2.3, 3.0, 6.0, 100.0):
        for re in REYNOLDS:
            case = Case(1.0, re, standard, f"tunnel:{h}")
            yield "tunnel, cylinder", f"H = {h:g}", f"Re {re:g}", case


def measure(tiny: bool, progress: Callable) -> Result:
    """Solve every field, compare with the fine grid where that flow is found."""
    reference, chosen, fields = FIDELITIES["fine"], list(cases()), []
    if tiny:
        reference = TINY
        chosen = [("tiny", f"aspect {a:g}", "Re 1", Case(a, 1.0, TINY)) for a in (1.0, 20.0)]
    for k, (panel, row, column, case) in enumerate(chosen):
        progress(k / len(chosen), f"{panel}, {row}, {column}")
        place = {"panel": panel, "row": row, "column": column}
        fields.append(place | _field(case, case._replace(fidelity=reference)))
        if k % 7 == 6:
            jax.clear_caches()  # Linux grants a process so many memory maps, and these add up
    silent = sum(field["outcome"] == "silently wrong" for field in fields)
    return {"fields": fields, "silently_wrong": silent}


def _field(case: Case, fine: Case) -> dict[str, Any]:
    """Outcome, drag, its estimated error, and that against the fine grid."""
    outcome, cd, estimate = _solve(case, estimate=True)
    truth = None if cd is None else _solve(fine, estimate=False)[1]
    error = None if truth is None else cd / truth - 1
    if outcome == "accurate" and abs(error or 0.0) > SILENT * case.fidelity.promise:
        outcome = "silently wrong"
    return {"outcome": outcome, "cd": cd, "estimated_error": estimate, "error": error}


@functools.cache
def _solve(case: Case, estimate: bool) -> tuple[str, float | None, float | None]:
    """Status, Cd and estimated error; or the word for why there are none."""
    flow, body = Flow(Scene(case.stream, fidelity=case.fidelity)), {"aspect": case.aspect}
    try:
        options = {"estimate": estimate, "allow_unsteady": True}
        found = flow.solve(family_shape(body), case.reynolds, **options)
    except InvalidInput:
        return "refused", None, None
    except NotConverged:
        return "not converged", None, None
    return found.status, found.drag, found.estimated_error


def tables(result: Result) -> str:
    """Errors against the fine grid, in brackets where the status warns."""
    silent = f"{result['silently_wrong']} of {len(result['fields'])} fields are called accurate and"
    promise = f"{silent} are off by more than {SILENT:g} times the promise."
    return f"{map_tables(result['fields'], _word)}\n\n{promise}"


def _word(field: Field) -> str:
    if field["cd"] is None:
        return field["outcome"]
    form = {"degraded": "({error:+.2%})", "silently wrong": "!! {error:+.2%}"}
    return words(form.get(field["outcome"], "{error:+.2%}"), **field)


def draw(result, path):
    def error(field):
        return "" if field["error"] is None else words("{error:+.1%}", **field)

    draw_maps(result["fields"], error, OUTCOMES, path)


STUDY = Study("extremes", measure, tables, draw)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
