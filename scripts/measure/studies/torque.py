"""The moment of inclined spheroids: its exact limit at small Re, and simulations by others."""

from correlations_at_incidence import Inclined, moment_by_inertia, ouchene
from study import Result, Row, Run, Study, Table, cases, columns
from tools import mean_and_most

from surrogate import Flow, Scene, family_shape, load

SURROGATE, INCIDENCE = "pretrained:particle", 45.0
CREEPING = (0.001, 0.01, 0.1)  # Re
SPHEROIDS = cases(aspect=(0.3, 0.5, 0.8, 1.25, 2.0, 4.0), fidelity=("draft", "standard", "fine"))
# Cm over its limit at small Re by Jiang et al. 2021, at Re by the longer half axis; as quoted in
# the source that ``ouchene`` names, whose comment says that the paper has them in no table
JIANG = {
    (1 / 3, 0.3): 0.879578485160704,
    (1 / 3, 3.0): 0.692434126615873,
    (1 / 3, 30.0): 0.505289768071043,
    (1 / 2, 0.3): 0.851105581379940,
    (1 / 2, 3.0): 0.666082628906040,
    (1 / 2, 30.0): 0.488460594531096,
}
BY_OTHERS = [{"aspect": aspect, "by_half_axis": re} for aspect, re in JIANG]


def flow_at(run: Run, fidelity: str) -> Flow:
    """Return the flow solver of a fidelity, by its name."""
    return Flow(Scene(dimension=3, fidelity=run.fidelity(fidelity, 3)))


def measure(run: Run, aspect: float, fidelity: str) -> Row:
    """Return the exact limit of Cm at 45 degrees, and the relative errors of flows at small Re."""
    exact = moment_by_inertia(aspect, INCIDENCE)
    shape = family_shape({"aspect": aspect, "incidence": INCIDENCE}, dimension=3)
    flow = flow_at(run, fidelity)
    found = [flow.solve(shape, re, estimate=False) for re in CREEPING]
    errors = [each.moment / exact - 1 for each in found]
    return {"exact": exact, "errors": errors, "share": found[0].moment / found[0].drag}


def beside_others(run: Run, aspect: float, by_half_axis: float) -> Row:
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


def with_others(rows: list[Row]) -> list[Row]:
    """Return rows of ``beside_others`` with the relative differences of others from the flow."""

    def differences(row):
        place = row["aspect"], row["by_half_axis"]
        correlation = ouchene(Inclined(row["aspect"], incidence=INCIDENCE), row["reynolds"])
        others = {
            "by_surrogate": row["surrogate"],
            "by_jiang": JIANG[place] * moment_by_inertia(row["aspect"], INCIDENCE),
            "by_ouchene": None if correlation is None else correlation.cm,
        }
        return {name: None if cm is None else cm / row["cm"] - 1 for name, cm in others.items()} | {
            "bound_over_cm": abs(row["bound"] / row["cm"])
        }

    return [row | differences(row) for row in rows]


def text(result: Result) -> str:
    """Return the mean and largest errors at the smallest Re of every fidelity, as a sentence."""
    rows = result["rows"]
    parts = []
    for name in dict.fromkeys(row["fidelity"] for row in rows):
        mean, most = mean_and_most([row["errors"][0] for row in rows if row["fidelity"] == name])
        parts.append(f"{name} {100 * mean:.1f} and {100 * most:.1f} %")
    others = [row["by_surrogate"] for row in with_others(result["others"])]
    mean, most = mean_and_most(others)
    return (
        f"Errors of Cm at Re {CREEPING[0]:g}, mean and largest: {', '.join(parts)}. The surrogate "
        f"differs from the flow by {100 * mean:.1f} % of Cm on average and by {100 * most:.1f} % "
        "at most in the lower table: it was trained for errors over Cd, of which Cm is a small "
        "part at low Re."
    )


LIMIT = columns(
    "aspect {aspect:g} | fidelity {fidelity} | exact Cm {exact:+.4f} | "
    + " | ".join(f"error at Re {re:g} {{errors[{k}]:+.1%}}" for k, re in enumerate(CREEPING))
    + f" | Cm / Cd at Re {CREEPING[0]:g} "
    + "{share:+.1e}"
)
OTHERS = columns(
    "aspect {aspect:.3f} | Re by the half axis {by_half_axis:g} | Re {reynolds:.3g}"
    " | Cm, flow {cm:+.4f} | its bound {bound_over_cm:.1%} | surrogate {by_surrogate:+.1%}"
    " | Jiang et al. {by_jiang:+.1%} | Ouchene {by_ouchene:+.1%}"
)
TABLES = [
    Table(SPHEROIDS, measure, LIMIT),
    Table(BY_OTHERS, beside_others, lambda rows: OTHERS(with_others(rows)), key="others"),
]
STUDIES = {"torque": Study(TABLES, text)}
