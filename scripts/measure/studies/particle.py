"""The shipped surrogate of particles beside the flow and the correlations of particle codes."""

import itertools
from collections.abc import Iterator

import numpy as np
from correlations import bagheri_bonadonna, ellipsoid
from correlations_at_incidence import AT_INCIDENCE, ZASTAWNY, Inclined, Loads, froehlich
from studies.particle_polars import (
    POLAR_REYNOLDS,
    POLARS,
    SURROGATE,
    draw,
    flow_of,
    polar,
    show_polars,
)
from study import Result, Row, Run, Study, Table, cases, columns
from tools import LOADS, mean_and_most

from shapeopt import Tumbling
from surrogate import load

SEED = 7  # the training used another seed
KINDS = {  # what is drawn of each: prolate spheroids, oblate ones, flattened ellipsoids, others
    "prolate": {"aspect": (1.05, 4.0)},
    "oblate": {"aspect": (0.3, 0.95)},
    "flattened": {"aspect": (0.5, 3.0), "flatness": (1.1, 2.0)},
    "fore and aft unlike": {"aspect": (0.5, 3.0), "beta2": (-0.3, 0.3)},
}
ORIENTED = cases(aspect=(0.5, 0.75, 1.6, 2.5, 3.8), reynolds=(1.0, 10.0, 80.0))
ENDS = (0.1, 1.0, 10.0, 100.0)  # of ranges of Re
ALIGNED = 5.0  # degrees from 0 and 90, within which lift and moment are too small to compare with


def bodies(run: Run) -> Iterator[Row]:
    """Yield random bodies of every kind at random incidence and Re.

    The first prolate ones have Zastawny's aspects.
    """
    scene = load(SURROGATE).scene
    for kind, ranges in KINDS.items():
        family = {"aspect": (1, 1), "flatness": (1, 1), "beta2": (0, 0), "incidence": (0, 90)}
        drawn = np.random.default_rng([SEED, *map(ord, kind)])
        for k in range(10):
            body = {n: drawn.uniform(*r) for n, r in (family | ranges).items()}
            if kind == "prolate" and k < 2 * len(ZASTAWNY):
                body["aspect"] = list(ZASTAWNY)[k % len(ZASTAWNY)]
            reynolds = np.exp(drawn.uniform(*np.log(scene.reynolds)))
            yield {"kind": kind, "parameters": body, "reynolds": float(reynolds)}


def measure(run: Run, kind: str, parameters: dict[str, float], reynolds: float) -> Row:
    """Return loads by the flow, and the errors of the surrogate over Cd.

    Args:
      run: How the study is run.
      kind: Of the body.
      parameters: By name.
      reynolds: U D / nu.
    """
    net = load(SURROGATE)
    body = net.scene.family.parameters(parameters)
    row: Row = dict(zip(LOADS, flow_of(run.tiny).loads(body, reynolds).tolist(), strict=True))
    return row | {"surrogate": _errors(row, Loads(*net.loads(body, reynolds).tolist()))}


def with_correlations(rows: list[Row]) -> list[Row]:
    """Return rows of ``measure`` with the errors of every correlation over Cd.

    They are None outside of its range.
    """

    def errors(row):
        body = Inclined(**row["parameters"])
        return {
            n: _errors(row, answer(body, row["reynolds"])) for n, answer in AT_INCIDENCE.items()
        }

    return [row | errors(row) for row in rows]


def _errors(row, answer):
    """Return the errors of an answer over Cd by the flow; None for loads that it has not."""
    given = zip(LOADS, answer or Loads(None), strict=True)
    return {name: None if load is None else (load - row[name]) / row["cd"] for name, load in given}


def oriented(run: Run, aspect: float, reynolds: float) -> Row:
    """Return a spheroid's mean Cd over random orientations, and the surrogate's error of it."""
    net = load(SURROGATE)
    cases = Tumbling(reynolds).scenarios(net.scene)
    bodies = net.scene.family.parameters({"aspect": aspect, "incidence": 45.0}) + cases.shift
    found = {}
    for name, model in (("flow", flow_of(run.tiny)), ("surrogate", net)):
        drags = [np.asarray(model.loads(body, reynolds))[0] for body in bodies]
        found[name] = float(cases.weight @ drags)
    return {"cd": found["flow"], "surrogate": found["surrogate"] / found["flow"] - 1}


def oriented_with_correlation(rows: list[Row]) -> list[Row]:
    """Return rows of ``oriented`` with the error of Bagheri and Bonadonna's correlation."""

    def error(row):
        return bagheri_bonadonna(ellipsoid(row["aspect"]), row["reynolds"]) / row["cd"] - 1

    return [row | {"bagheri_bonadonna": error(row)} for row in rows]


def show_oriented(rows: list[Row]) -> str:
    """Return the table of mean Cd over random orientations."""
    return OVER_ANGLES(oriented_with_correlation(rows))


def text(result: Result) -> str:
    """Return tables of the errors by kind of body and by Re, and a sentence on random orientations.

    Correlations are compared within their ranges.
    """
    rows = with_correlations(result["rows"])
    turned = oriented_with_correlation(result["oriented"])
    groups = {"all": rows} | {k: [row for row in rows if row["kind"] == k] for k in KINDS}
    by_kind = [
        {"by": name, "kind": kind} | _mean_and_largest(group, name)
        for name in ("surrogate", *AT_INCIDENCE)
        for kind, group in groups.items()
        if any(_is_answered(row, name) for row in group)
    ]
    by_reynolds = [_over_themselves_between(rows, *ends) for ends in itertools.pairwise(ENDS)]
    means = [
        "{:.2%} on average and {:.2%} at most".format(*mean_and_most([row[name] for row in turned]))
        for name in ("surrogate", "bagheri_bonadonna")
    ]
    parts = [
        f"The tables of Cd, Cl and Cm and the picture are polars at Re {POLAR_REYNOLDS:g}. Of "
        "oblate spheroids no correlation here has lift. Over random orientations the "
        f"surrogate errs by {means[0]}, Bagheri and Bonadonna's correlation by {means[1]}.",
        "Errors over Cd by the flow, mean and largest, of bodies that no training has seen, each "
        "correlation within its range:",
        BY_KIND(by_kind),
        "Errors of the surrogate's Cl and Cm over these loads themselves, median and largest, of "
        f"bodies at more than {ALIGNED:g} degrees from the stream and from across it:",
        BY_REYNOLDS(by_reynolds),
    ]
    return "\n\n".join(parts)


def _mean_and_largest(rows, name):
    """Mean and largest errors over Cd of a model or correlation, and of how many bodies."""
    found = {"bodies": sum(_is_answered(row, name) for row in rows)}
    for key in LOADS:
        errors = [row[name][key] for row in rows if row[name][key] is not None]
        mean, most = mean_and_most(errors) if errors else (None, None)
        found |= {key: mean, f"{key}_most": most}
    return found


def _is_answered(row, name):
    """Return whether a model or correlation answers any load of a body."""
    return any(error is not None for error in row[name].values())


def _over_themselves_between(rows, low, high):
    """Median and largest errors of Cl and Cm over themselves, between two Reynolds numbers."""
    some = [row for row in _inclined(rows) if low <= row["reynolds"] < high]
    errors = _over_themselves(some)
    found = {"range": f"{low:g} to {high:g}", "bodies": len(some)}
    for key, each in errors.items():
        found |= {key: np.median(each) if each else None, f"{key}_most": max(each, default=None)}
    return found


def _inclined(rows):
    """Rows of bodies at more than ``ALIGNED`` degrees from the stream and from across it."""
    return [r for r in rows if ALIGNED < r["parameters"]["incidence"] < 90.0 - ALIGNED]


def _over_themselves(rows, by="surrogate"):
    """Return the errors of Cl and Cm over these loads by a model or correlation, by symbol."""
    answered = {
        "Cl": [(row, "cl") for row in rows if row[by]["cl"] is not None],
        "Cm": [(row, "cm") for row in rows if row[by]["cm"] is not None],
    }
    return {
        symbol: [abs(row[by][name] * row["cd"] / row[name]) for row, name in each]
        for symbol, each in answered.items()
    }


def in_short(result: Result) -> str:
    """Return a sentence on the errors of the shipped surrogate and of the best correlation."""

    def means(name, rows):
        errors = [[row[name][key] for row in rows] for key in LOADS]
        return "/".join(f"{100 * mean_and_most(each)[0]:.2f}" for each in errors)

    rows = with_correlations(result["rows"])
    theirs = [row for row in rows if row["Froehlich"]["cd"] is not None]
    as_in_code = [
        _errors(row, froehlich(Inclined(**row["parameters"]), row["reynolds"], as_in_code=True))
        for row in theirs
    ]
    lift = mean_and_most([each["cl"] for each in as_in_code])[0]
    oblate = [row for row in _inclined(rows) if row["Ouchene"]["cm"] is not None]
    ours, other = (np.median(_over_themselves(oblate, n)["Cm"]) for n in ("surrogate", "Ouchene"))
    slow = _over_themselves([row for row in _inclined(rows) if row["reynolds"] < 1.0])["Cm"]
    return (
        f"On {len(theirs)} prolate spheroids at incidence `{SURROGATE}` is off this flow by "
        f"{means('surrogate', theirs)} %, Froehlich's correlation (of another solver) by "
        f"{means('Froehlich', theirs)} % (Cl by the authors' code {100 * lift:.2f} %). Cm of "
        f"{len(oblate)} oblate ones errs by {100 * ours:.1f} % of itself (median), "
        f"Ouchene's by {100 * other:.1f} %; below Re 1 the surrogate's Cm by "
        f"{100 * np.median(slow):.0f} %, {100 * max(slow):.0f} % at most."
    )


BY_KIND = columns(
    "by {by} | kind {kind} | bodies {bodies} | Cd: mean {cd:.2%} | largest {cd_most:.2%}"
    " | Cl: mean {cl:.2%} | largest {cl_most:.2%} | Cm: mean {cm:.2%} | largest {cm_most:.2%}"
)
BY_REYNOLDS = columns(
    "Re {range} | bodies {bodies} | Cl: median {Cl:.1%} | largest {Cl_most:.0%}"
    " | Cm: median {Cm:.1%} | largest {Cm_most:.0%}"
)
COLUMNS = columns(
    "kind {kind} | body {parameters[aspect]:.2f}, {parameters[flatness]:.2f}, "
    "{parameters[beta2]:+.2f} | incidence {parameters[incidence]:.1f} | Re {reynolds:.3g}"
    " | Cd {cd:.4f} | Cl {cl:+.4f} | Cm {cm:+.4f}"
    " | error of the surrogate {surrogate[cd]:+.2%}, {surrogate[cl]:+.2%}, {surrogate[cm]:+.2%}"
)
OVER_ANGLES = columns(
    "aspect {aspect:g} | Re {reynolds:g} | mean Cd over orientations, flow {cd:.4f}"
    " | error of the surrogate {surrogate:+.2%} | of Bagheri and Bonadonna {bagheri_bonadonna:+.2%}"
)
TABLES = [
    Table(bodies, measure, COLUMNS),
    Table(POLARS, polar, show_polars, key="polar"),
    Table(ORIENTED, oriented, show_oriented, key="oriented"),
]
STUDIES = {"particle": Study(TABLES, text, draw=draw)}
