"""Where the 2-D flow solver converges, where it refuses or warns, and how large its error is.

Of ellipses along the stream, and of ellipses and cambered sections at incidence.
"""

import contextlib
import dataclasses
import functools

from figures import draw_maps
from lifting_elements import SECTION, unbounded_loads
from study import TINY, Result, Row, Run, Study, Table, Unavailable, cases, maps, panel, words
from tools import SILENT, bounds_of, relative_error, solved

from surrogate import FIDELITIES, Fidelity, InvalidInput, NotConverged, family_shape
from surrogate.flow.check.error_estimate import load_tolerances
from surrogate.scene.limits import onset_of

OUTCOMES = {"accurate": "#4c9f70", "degraded": "#f2b134", "not converged": "#e08e58"}
OUTCOMES |= {"refused": "#b8bec9", "silently wrong": "#d81b60"}
NUMBERS = (1e-3, 0.1, 1.0, 10.0, 40.0, 100.0, 300.0)
BODIES = {"ellipse": {}, "section": {"beta2": 0.2, "beta3": 0.08, "gamma2": 0.4, "gamma3": 0.1}}
STEADY = (0.01, 1.0, 10.0, 40.0, 100.0, 300.0)  # Re at incidence, refused beyond the onset
LOADS = {"Cd": "drag", "Cl": "lift", "Cm": "moment"}
REFINEMENT = 1.5  # of the fine grid at most, for thin boundary layers
FINER = 1.5  # least ratio of the cells of the finer grid to those of the flow
LAYERS = SECTION._replace(wall=0.03, near=0.12)  # elements, where that grid is little finer
ASPECTS = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)


def extremes(run: Run) -> list[Row]:
    """Return the cases: ellipses over Re, over cells, over the domain, and in tunnels."""
    standard, replace = FIDELITIES["standard"], dataclasses.replace
    at = "aspect {aspect:g}", "Re {reynolds:g}"
    if run.tiny:
        return panel("tiny", *at, cases(fidelity=[TINY], aspect=(1.0, 20.0), reynolds=[1.0]))
    levels = [FIDELITIES[name] for name in ("draft", "standard")]
    grids = [replace(standard, cells=n) for n in (4, 6, 8, 12, 16, 24, 32)]
    domains = [
        replace(standard, upstream=u, downstream=d, height=h)
        for u, d, h in ((2.5, 2.5, 4), (3, 4, 5), (4, 8, 8), (6, 12, 8))
    ]
    cylinder, tunnels = {"aspect": [1.0], "reynolds": NUMBERS}, (1.5, 2.3, 3.0, 6.0, 100.0)
    size = "{fidelity.upstream:g} + {fidelity.downstream:g} by {fidelity.height:g}"
    cells = cases(fidelity=grids, aspect=ASPECTS, reynolds=[10.0])
    walls = cases(fidelity=[standard], stream=[f"tunnel:{h}" for h in tunnels], **cylinder)
    walls = [case | {"height": float(case["stream"].removeprefix("tunnel:"))} for case in walls]
    return [
        *panel("{fidelity.name}", *at, cases(fidelity=levels, aspect=ASPECTS, reynolds=NUMBERS)),
        *panel("cells per D, Re 10", "n = {fidelity.cells}", at[0], cells),
        *panel("domain, cylinder", size, at[1], cases(fidelity=domains, **cylinder)),
        *panel("tunnel, cylinder", "H = {height:g}", at[1], walls),
    ]


def outcome(run, aspect, reynolds, fidelity, stream="unbounded", **_) -> Row:
    """Return the outcome, the drag, its estimated error, and its error against the fine grid.

    There is no error beyond the onset of instability, where fine flows take hours.

    Args:
      run: How the study is run.
      aspect: Of the ellipse.
      reynolds: U D / nu.
      fidelity: Of the flow.
      stream: As for ``parse_stream``.
      **_: The rest of the case.
    """
    found, cd, estimate = _solve(aspect, reynolds, fidelity, stream, True)
    fine = run.fidelity("fine")
    known = cd is not None and reynolds <= onset_of(family_shape({"aspect": aspect}))
    truth = _solve(aspect, reynolds, fine, stream, False)[1] if known else None
    error = relative_error(cd, truth)
    if found == "accurate" and abs(error or 0.0) > SILENT * fidelity.tolerance:
        found = "silently wrong"
    return {"outcome": found, "cd": cd, "estimated_error": estimate, "error": error}


@functools.cache
def _solve(aspect: float, re: float, fidelity: Fidelity, stream: str, estimate: bool) -> tuple:
    """Return the status, Cd and its bound; or why there is no flow, None and None."""
    options = {"estimate": estimate, "allow_unsteady": True}
    try:
        found = solved({"aspect": aspect}, re, fidelity, stream=stream, **options)
    except InvalidInput:
        return "refused", None, None
    except NotConverged:
        return "not converged", None, None
    return found.status, found.drag, found.estimated_error


def sections(run: Run) -> list[Row]:
    """Return the cases: ellipses and cambered sections at incidence over aspect and Re."""
    bodies = {"aspect": (1.5, 3.0, 6.0, 12.0), "reynolds": STEADY}
    angles = cases(kind=["ellipse"], incidence=(10.0, 20.0, 30.0), **bodies)
    angles += cases(kind=["section"], incidence=(-10.0, 0.0, 10.0, 20.0, 30.0), **bodies)
    at = "{kind}, incidence {incidence:g}", "aspect {aspect:g}", "Re {reynolds:g}"
    return panel(*at, run.pick(angles[:1], angles))


def loads_of_section(
    run: Run, kind: str, incidence: float, aspect: float, reynolds: float, **_
) -> Row:
    """Return the outcome, and errors of the loads over Cd against a finer grid, or elements.

    That grid has a larger domain, too. Where it would be little finer, body-fitted elements are the
    reference, if NGSolve is installed.

    Args:
      run: How the study is run.
      kind: One of ``BODIES``.
      incidence: In degrees.
      aspect: Of the body.
      reynolds: U D / nu.
      **_: The rest of the case.
    """
    body = {"aspect": aspect, "incidence": incidence} | BODIES[kind]
    fine = dataclasses.replace(run.fidelity("fine"), refinement=REFINEMENT)
    if reynolds > onset_of(family_shape(body)):
        return {"outcome": "unsteady"}
    flow = functools.partial(solved, body, reynolds, allow_unsteady=False)
    try:
        found = flow(run.fidelity("standard"), estimate=True)
    except InvalidInput:
        return {"outcome": "refused"}
    except NotConverged:
        return {"outcome": "not converged"}
    row = {"outcome": found.status}
    cells = fine.for_layers(reynolds, family_shape(body).nose).cells
    by_grid = run.tiny or cells >= FINER * found.fidelity.cells
    with contextlib.suppress(Unavailable):  # then there is no finer flow
        truth = flow(fine).loads if by_grid else unbounded_loads(body, reynolds, LAYERS)
        row["reference"] = "grid" if by_grid else "elements"
        for k, (load, bound) in enumerate(zip(LOADS.values(), bounds_of(found), strict=True)):
            row[f"{load}_error"] = (found.loads[k] - truth[k]) / truth[0]
            row[f"{load}_bound"] = None if bound is None else bound / truth[0]
    return row


def section_cell(row: Row) -> str:
    """Return the errors of Cd and Cl over Cd as text, in brackets where the status warns."""
    if "drag_error" not in row:
        return row["outcome"]
    text = words("{drag_error:+.2%}, {lift_error:+.2%}", **row)
    return f"({text})" if row["outcome"] == "degraded" else text


def sections_text(result: Result) -> str:
    """Return a sentence on how many errors are within their bounds and tolerances."""
    rows = result["fields"]
    known = [row for row in rows if row.get("drag_bound") is not None]
    within = {
        symbol: sum(row[f"{load}_bound"] >= abs(row[f"{load}_error"]) for row in known)
        for symbol, load in LOADS.items()
    }
    counts = ", ".join(f"{count} of {symbol}" for symbol, count in within.items())
    lost, refused = (
        sum(row["outcome"] == outcome for row in rows) for outcome in ("not converged", "unsteady")
    )
    fitted = sum(row.get("reference") == "elements" for row in known)
    called = [row for row in known if row["outcome"] == "accurate"]
    most = load_tolerances(FIDELITIES["standard"].tolerance)._asdict()
    over = sum(any(abs(row[f"{load}_error"]) > most[load] for load in most) for row in called)
    return (
        f"Of {len(rows)} flows {refused} are refused as unsteady, and {lost} did not converge; of "
        f"{len(known)} with an estimate and a known error ({fitted} of them by elements) the bound "
        f"covers the error of {counts}. "
        f"Of {len(called)} that are called accurate {over} exceed a tolerance; their largest "
        f"errors are {_largest(called)}."
    )


def _largest(rows):
    """Return the largest error over Cd of each load in words, and of which flow it is."""
    parts = []
    for symbol, load in LOADS.items():
        worst = max(rows, key=lambda row: abs(row[f"{load}_error"]), default=None)
        if worst:
            place = ", ".join(worst[name] for name in ("panel", "row", "column"))
            parts.append(f"{symbol} {100 * worst[f'{load}_error']:+.2f} % ({place})")
    return ", ".join(parts) or "not known"


def cell(row: Row) -> str:
    """Return the error as text, in brackets where the status warns; the outcome without one."""
    if row["error"] is None:
        return row["outcome"]
    form = {"degraded": "({error:+.2%})", "silently wrong": "!! {error:+.2%}"}
    return words(form.get(row["outcome"], "{error:+.2%}"), **row)


def extremes_text(result: Result) -> str:
    """Return a sentence on how many drags are called accurate and are not."""
    called = [row for row in result["fields"] if row["outcome"] in ("accurate", "silently wrong")]
    known = [row for row in called if row["error"] is not None]
    silent = sum(row["outcome"] == "silently wrong" for row in known)
    over = sum(abs(row["error"]) > FIDELITIES.get(row["fidelity"], TINY).tolerance for row in known)
    return (
        f"Of {len(known)} flows that are called accurate and whose error is known, {over} exceed "
        f"the error tolerance, {silent} by more than {SILENT:g} times."
    )


def draw(result, path):
    """Draw maps of the outcomes."""
    form = {True: "", False: "{error:+.1%}"}
    rows = result["fields"]
    draw_maps(rows, lambda row: words(form[row["error"] is None], **row), OUTCOMES, path)


TABLE = Table(extremes, outcome, maps(cell), "fields", "all")
AT_INCIDENCE = Table(sections, loads_of_section, maps(section_cell), "fields", "all")
STUDIES = {
    "extremes": Study([TABLE], extremes_text, draw=draw),
    "extremes_lift": Study([AT_INCIDENCE], sections_text),
}
