"""How often error bounds cover the errors, how tight they are, and whether the status misleads."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from study import Row, values
from tools import SILENT

from surrogate.flow.check.error_estimate import load_tolerances

FLOOR = 5e-4  # smaller errors count as this one, the uncertainty of fine grids


def summary(rows: Sequence[Row], kinds: Iterable[str]) -> Iterator[Row]:
    """Yield how often the bound covers the error and the status misleads, by kind and of all."""
    for kind in (*kinds, "all"):
        mine = [row for row in rows if kind in (row["kind"], "all")]
        judged = [row for row in mine if row.get("bound") is not None]
        accurate = [row for row in judged if row["status"] == "accurate"]
        within = [row for row in judged if abs(row["error"]) <= row["tolerance"]]
        yield {
            "kind": kind,
            "cases": len(mine),
            "judged": len(judged),
            **bound_coverage([row["bound"] for row in judged], [row["error"] for row in judged]),
            "within": len(within),
            "degraded": sum(row["status"] == "degraded" for row in within),
            "accurate": len(accurate),
            "over": sum(abs(row["error"]) > row["tolerance"] for row in accurate),
            "most": max((abs(row["error"]) for row in accurate), default=None),
            "silent": sum(abs(row["error"]) > SILENT * row["tolerance"] for row in accurate),
        }


def lift_and_moment(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield coverage by the bounds of Cl and Cm, and largest errors of flows called accurate."""
    lifting = [row for row in rows if row.get("lift_bound") is not None and row["lift"]]
    for kind in values(lifting, "kind"):
        mine = [row for row in lifting if row["kind"] == kind]
        for load, symbol in (("lift", "Cl"), ("moment", "Cm")):
            errors = [abs(row[f"{load}_error"]) / row["drag"] for row in mine]
            bounds = [row[f"{load}_bound"] / row["drag"] for row in mine]
            accurate = [
                (error, getattr(load_tolerances(row["tolerance"]), load))
                for row, error in zip(mine, errors, strict=True)
                if row["status"] == "accurate"
            ]
            yield {
                "kind": kind,
                "load": symbol,
                "cases": len(mine),
                **bound_coverage(bounds, errors),
                "accurate": len(accurate),
                "over": sum(error > most for error, most in accurate),
                "most": max((error for error, _ in accurate), default=None),
            }


def bound_coverage(bounds: Iterable[float | None], errors: Iterable[float]) -> Row:
    """Return the share of errors that their bounds cover, and the median bound over error.

    Both are None where no bound is known; errors below ``FLOOR`` count as that in the ratio.
    """
    pairs = zip(bounds, map(abs, errors), strict=True)
    known = [(bound, error) for bound, error in pairs if bound is not None]
    if not known:
        return {"covered": None, "ratio": None}
    covered = sum(bound >= error for bound, error in known) / len(known)
    ratio = float(np.median([bound / max(error, FLOOR) for bound, error in known]))
    return {"covered": covered, "ratio": ratio}
