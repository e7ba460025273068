"""The payoff's result in words: break-even, verified drags, the robust design."""

from collections.abc import Mapping
from typing import Any

from shapeopt.render.tables import markdown


def payoff_tables(result: Mapping[str, Any]) -> str:
    """Markdown of what the payoff command has found."""
    rows, robust = result["payoff"], result["robust"]
    hours = robust["direct_seconds_extrapolated"] / 3600
    return "\n\n".join(
        [
            break_even_table(rows),
            f"{len(result['direct'])} queries; in brackets 95 % intervals",
            _drag_table(result),
            f"Robust design: {robust['calls']} drags in {robust['seconds']:.2f} s; by flows and "
            f"adjoints {hours:.1f} hours, extrapolated from {robust['sampled_flows']}.",
        ]
    )


def break_even_table(rows: list[Mapping[str, Any]]) -> str:
    """One line a method, and the direct optimiser's."""
    heads = ["method", "error mean / max", "training", "a design", "gap to direct"]
    heads += ["pays after designs, by time", "by G"]
    lines = [
        [
            r["method"],
            f"{100 * r['drag_error_mean']:.2f} / {100 * r['drag_error_max']:.2f} %",
            _bill(r["training"]),
            _bill(r["per_design"]),
            f"{100 * r['gap_mean']:+.3f} % (max {100 * r['gap_max']:+.2f} %)",
            _designs(r["seconds"]),
            _designs(r["green_applications"]),
        ]
        for r in rows
    ]
    return markdown(heads, [*lines, ["direct", "", "", _bill(rows[0]["per_direct"]), "", "", ""]])


def _drag_table(result):
    """Verified Cd of the plain queries, by the first seed of every method."""
    designs = result["designs"]
    rows = [
        [
            f"Re {result['queries'][k]['reynolds']:g}",
            f"{result['direct'][k]:.4f}",
            *(f"{seeds[0][k]:.4f}" for seeds in designs.values()),
        ]
        for k in range(result["plain"])
    ]
    return markdown(["verified Cd", "direct", *designs], rows)


def _designs(found):
    if found["designs"] is None:
        return "never"
    low, high = ("never" if found[k] is None else f"{found[k]:.1f}" for k in ("low", "high"))
    return f"{found['designs']:.1f} ({low} to {high})"


def _bill(bill):
    return f"{bill['seconds']:.2f} s, {bill['green_applications']:.0f} G"
