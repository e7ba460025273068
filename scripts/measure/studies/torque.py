"""The moment of inclined spheroids against its exact limit at small Re, and a correlation of it."""

from correlations_at_incidence import Inclined, moment_by_inertia, ouchene
from study import Result, Row, Run, Study, Table, cases, columns
from tools import mean_and_most

from surrogate import Flow, Scene, family_shape, load

SURROGATE, INCIDENCE = "pretrained:particle", 45.0
CREEPING = (0.001, 0.01, 0.1)  # Re
SPHEROIDS = cases(aspect=(0.3, 0.5, 0.8, 1.25, 2.0, 4.0), fidelity=("draft", "standard", "fine"))
OBLATES = cases(aspect=(1 / 3, 1 / 2), by_half_axis=(0.3, 3.0, 30.0))


def flow_at(run: Run, fidelity: str) -> Flow:
    """Return the flow solver of a fidelity, by its name."""
    return Flow(Scene(dimension=3, fidelity=run.fidelity(fidelity, 3)))


def measure(run: Run, aspect: float, fidelity: str) -> Row:
    """Return the limit of Cm at 45 degrees, and relative differences of flows at small Re."""
    exact = moment_by_inertia(aspect, INCIDENCE)
    shape = family_shape({"aspect": aspect, "incidence": INCIDENCE}, dimension=3)
    flow = flow_at(run, fidelity)
    found = [flow.solve(shape, re, estimate=False) for re in CREEPING]
    errors = [each.moment / exact - 1 for each in found]
    return {"exact": exact, "errors": errors, "share": found[0].moment / found[0].drag}


def at_higher_reynolds(run: Run, aspect: float, by_half_axis: float) -> Row:
    """Return Cm of an oblate spheroid at 45 degrees by the flow and by the shipped surrogate.

    Args:
      run: How the study is run.
      aspect: Of the spheroid.
      by_half_axis: Re by its longer half axis.
    """
    reynolds = by_half_axis * 2 * aspect ** (1 / 3)  # the longer half axis is D / 2 aspect^(1/3)
    shape = family_shape({"aspect": aspect, "incidence": INCIDENCE}, dimension=3)
    found = flow_at(run, "standard").solve(shape, reynolds)
    by_surrogate = float(load(SURROGATE).loads([aspect, 1.0, 0.0, INCIDENCE], reynolds)[2])
    row = {"reynolds": reynolds, "cm": found.moment, "bound": found.estimated_moment_error}
    return row | {"surrogate": by_surrogate}


def with_correlation(rows: list[Row]) -> list[Row]:
    """Return rows of ``at_higher_reynolds`` over the limit, and with differences from the flow."""

    def differences(row):
        body = Inclined(row["aspect"], incidence=INCIDENCE)
        theirs = ouchene(body, row["reynolds"])
        cm, limit = row["cm"], moment_by_inertia(row["aspect"], INCIDENCE)
        return {
            "over_limit": cm / limit,
            "bound_over_cm": abs(row["bound"] / cm),
            "by_surrogate": row["surrogate"] / cm - 1,
            "by_ouchene": None if theirs is None else theirs.cm / cm - 1,
        }

    return [row | differences(row) for row in rows]


def text(result: Result) -> str:
    """Return the differences at the smallest Re of every fidelity, and the lower table in words."""
    parts, rows = [], result["rows"]
    for name in dict.fromkeys(row["fidelity"] for row in rows):
        mean, most = mean_and_most([row["errors"][0] for row in rows if row["fidelity"] == name])
        parts.append(f"{name} {100 * mean:.1f} and {100 * most:.1f} %")
    others = with_correlation(result["others"])
    mean, most = mean_and_most([row["by_surrogate"] for row in others])
    theirs = [row for row in others if row["by_ouchene"] is not None]
    text = (
        f"Errors of Cm at Re {CREEPING[0]:g}, mean and largest: {', '.join(parts)}. Up to Re "
        f"{CREEPING[-1]:g} Cm falls below its limit, by as much on all grids. In the lower table "
        f"the surrogate differs from the flow by {100 * mean:.1f} % of Cm on average and by "
        f"{100 * most:.1f} % at most: it was trained for errors over Cd, of which Cm is a small "
        "part at low Re."
    )
    if not theirs:
        return text
    least, most = (pick(abs(row["by_ouchene"]) for row in theirs) for pick in (min, max))
    outside = sum(abs(row["by_ouchene"]) > row["bound_over_cm"] for row in theirs)
    return (
        f"{text} Ouchene's correlation differs by {100 * least:.1f} to {100 * most:.1f} %, in "
        f"{outside} of {len(theirs)} cases by more than the flow's bound."
    )


LIMIT = columns(
    "aspect {aspect:g} | fidelity {fidelity} | exact limit of Cm {exact:+.4f} | "
    + " | ".join(
        f"difference from it at Re {re:g} {{errors[{k}]:+.1%}}" for k, re in enumerate(CREEPING)
    )
    + f" | Cm / Cd at Re {CREEPING[0]:g} "
    + "{share:+.1e}"
)
HIGHER = columns(
    "aspect {aspect:.3f} | Re by the half axis {by_half_axis:g} | Re {reynolds:.3g}"
    " | Cm by the flow {cm:+.4f} | over the limit {over_limit:.3f} | bound {bound_over_cm:.1%}"
    " | surrogate {by_surrogate:+.1%} | Ouchene {by_ouchene:+.1%}"
)
TABLES = [
    Table(SPHEROIDS, measure, LIMIT),
    Table(OBLATES, at_higher_reynolds, lambda rows: HIGHER(with_correlation(rows)), key="others"),
]
STUDIES = {"torque": Study(TABLES, text)}
