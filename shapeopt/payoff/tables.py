"""The payoff's result in words: what every way costs, and after how many designs it pays."""

from collections.abc import Mapping, Sequence
from typing import Any

from shapeopt.payoff.break_even import (
    Strategy,
    best_known,
    overtakes,
    pays_after,
    per_design,
    quality,
)
from shapeopt.render.tables import markdown

SHORT = {"seconds": "s", "green_applications": "g"}


def payoff_rows(
    ways: Sequence[Strategy], rivals: Sequence[Strategy], seed: int
) -> list[dict[str, Any]]:
    """One row a way, as the contract of the payoff's JSON names it; None is never."""
    direct, kriging = rivals[0], rivals[-1]
    best = best_known([*ways, *rivals])
    rows = []
    for way in [*rivals, *ways]:
        row: dict[str, Any] = {"method": way.name}
        for unit, short in SHORT.items():
            row[f"training_{short}"] = float(way.bills(unit).mean())
            found = pays_after(way, direct, unit, seed)
            finite = [None if value == float("inf") else value for value in vars(found).values()]
            row[f"break_even_{short}"], *row[f"break_even_{short}_interval"] = finite
            row[f"beats_kriging_{short}"] = overtakes(way, kriging, unit)
            row[f"cumulative_{short}"] = way.cumulative(unit, 1000)[[0, 4, 9, 49, 999]].tolist()
        row |= per_design(way) | quality(way, best)
        row |= {"drag_error_mean": way.drag_error_mean, "drag_error_max": way.drag_error_max}
        rows.append(row)
    return rows


def payoff_tables(result: Mapping[str, Any]) -> str:
    """Markdown of what the payoff command has found."""
    robust, count = result["robust"], len(result["queries"])
    hours = robust["direct_seconds_extrapolated"] / 3600
    return "\n\n".join(
        [
            break_even_table(result["payoff"]),
            f"{count} queries, every design the flow's own optimum; in brackets 95 % intervals",
            _cumulative_table(result["payoff"]),
            f"Robust design by the network alone: {robust['calls']} drags in "
            f"{robust['seconds']:.2f} s, compilation included; by flows and adjoints {hours:.1f} "
            f"hours, extrapolated from {robust['sampled_flows']}.",
        ]
    )


def break_even_table(rows: list[Mapping[str, Any]]) -> str:
    """One line a way."""
    heads = ["way", "error mean / max", "training", "flows a design", "a design"]
    heads += ["gap, KKT at most", "pays after designs, by G", "by time", "beats kriging, by G"]
    lines = [
        [
            r["method"],
            _error(r),
            f"{r['training_g']:.0f} G, {r['training_s']:.0f} s" if r["training_g"] else "",
            f"{r['flows_per_design']:.2f}",
            f"{r['g_per_design']:.0f} G, {r['s_per_design']:.2f} s",
            f"{100 * r['gap_max']:.3f} %, {r['kkt_max']:.0e}",
            _designs(r, "g"),
            _designs(r, "s"),
            _from(r["beats_kriging_g"]) if r["training_g"] else "",
        ]
        for r in rows
    ]
    return markdown(heads, lines)


def short_table(rows: list[Mapping[str, Any]]) -> str:
    """Who pays when, in few columns: without the methods as published."""
    heads = ["way", "training", "flows a design", "a design", "pays after designs, by G", "by time"]
    lines = [
        [
            r["method"],
            f"{r['training_g']:.0f} G, {r['training_s']:.0f} s" if r["training_g"] else "",
            f"{r['flows_per_design']:.2f}",
            f"{r['g_per_design']:.0f} G, {r['s_per_design']:.2f} s",
            _designs(r, "g"),
            _designs(r, "s"),
        ]
        for r in rows
        if "published" not in r["method"]
    ]
    return markdown(heads, lines)


def _cumulative_table(rows):
    heads = ["applications of G after designs", "1", "5", "10", "50", "1000"]
    return markdown(heads, [[r["method"], *(f"{g:,.0f}" for g in r["cumulative_g"])] for r in rows])


def _error(row):
    if row["drag_error_mean"] is None:
        return ""
    return f"{100 * row['drag_error_mean']:.3f} / {100 * row['drag_error_max']:.2f} %"


def _from(designs):
    return "never" if designs is None else f"from design {designs}"


def _designs(row, short):
    if not row["training_g"]:
        return ""
    found, (low, high) = row[f"break_even_{short}"], row[f"break_even_{short}_interval"]
    if found is None:
        return "never"
    low, high = ("never" if end is None else f"{end:.1f}" for end in (low, high))
    return f"{found:.1f} ({low} to {high})"
