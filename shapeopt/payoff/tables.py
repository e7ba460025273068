"""The payoff's result as rows of JSON and as tables: costs of all strategies, and break-even."""

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

SUFFIXES = {"seconds": "s", "green_applications": "g"}  # of the keys in JSON
COSTS = ("training", "flows a design", "a design")
PAYS = ("break-even, designs by G", "by time")
SHOWN_DESIGNS = (1, 5, 10, 50, 1000)  # numbers of designs whose cumulative cost is shown
Row = Mapping[str, Any]


def payoff_rows(
    strategies: Sequence[Strategy], rivals: Sequence[Strategy], seed: int
) -> list[dict[str, Any]]:
    """Return one row of JSON for each strategy, the rivals first; a break-even of None means never.

    ``rivals`` are as ``strategies.rivals`` returns them, direct optimisation first and kriging with
    memory last; ``seed`` is that of the bootstrap intervals.
    """
    direct, kriging = rivals[0], rivals[-1]
    best = best_known([*strategies, *rivals])
    rows = []
    for one in [*rivals, *strategies]:
        row: dict[str, Any] = {"method": one.name}
        for unit, suffix in SUFFIXES.items():
            row[f"training_{suffix}"] = float(one.training_costs(unit).mean())
            found = vars(pays_after(one, direct, unit, seed)).values()
            finite = [None if value == float("inf") else value for value in found]
            row[f"break_even_{suffix}"], *row[f"break_even_{suffix}_interval"] = finite
            row[f"beats_kriging_{suffix}"] = overtakes(one, kriging, unit)
            costs = one.cumulative(unit, SHOWN_DESIGNS[-1])
            row[f"cumulative_{suffix}"] = [float(costs[count - 1]) for count in SHOWN_DESIGNS]
        row |= per_design(one) | quality(one, best)
        row |= {"drag_error_mean": one.drag_error_mean, "drag_error_max": one.drag_error_max}
        rows.append(row)
    return rows


def payoff_tables(result: Row) -> str:
    """Return the result of the payoff command as Markdown."""
    robust, count = result["robust"], len(result["queries"])
    return "\n\n".join(
        [
            break_even_table(result["payoff"]),
            f"{count} queries, every design the flow's own optimum; the flows of held-out bodies, "
            "by which errors are measured, are not counted; in brackets 95 % intervals"
            + _left_out(result["left_out"]),
            _cumulative_table(result["payoff"]),
            f"Robust design by the network alone: {robust['calls']} drags in "
            f"{robust['seconds']:.2f} s, compilation included.",
        ]
    )


def break_even_table(rows: Sequence[Row]) -> str:
    """Return errors, costs, quality and break-even as Markdown, one line for each strategy."""
    heads = [
        "strategy",
        "error mean / max",
        *COSTS,
        "largest gap, KKT residual",
        *PAYS,
        "beats kriging, by G",
    ]
    lines = [
        [
            row["method"],
            _error(row),
            *_costs(row),
            f"{100 * row['gap_max']:.3f} %, {row['kkt_max']:.0e}",
            *_break_evens(row),
            _from(row["beats_kriging_g"]) if row["training_g"] else "",
        ]
        for row in rows
    ]
    return markdown(heads, lines)


def short_table(rows: Sequence[Row]) -> str:
    """Return errors, costs and break-even by work, without the methods as published."""
    chosen = [row for row in rows if "published" not in row["method"]]
    lines = [[row["method"], _error(row), *_costs(row), _break_evens(row)[0]] for row in chosen]
    return markdown(["strategy", "error of Cd: mean / max", *COSTS, PAYS[0]], lines)


def _left_out(missing):
    """Return which queries were not answered by every strategy; empty if all were."""
    reasons = [f"Re {one['reynolds']:.3g} by {one['by']}: {one['reason']}" for one in missing]
    return "".join(f"; left out for all, as not answered: {reason}" for reason in reasons)


def _cumulative_table(rows):
    heads = ["convolutions (G) after designs", *map(str, SHOWN_DESIGNS)]
    return markdown(heads, [[r["method"], *(f"{g:,.0f}" for g in r["cumulative_g"])] for r in rows])


def _costs(row):
    return [
        f"{row['training_g']:.0f} G, {row['training_s']:.0f} s" if row["training_g"] else "",
        f"{row['flows_per_design']:.2f}",
        f"{row['g_per_design']:.0f} G, {row['s_per_design']:.2f} s",
    ]


def _break_evens(row):
    return [_break_even(row, suffix) if row["training_g"] else "" for suffix in ("g", "s")]


def _break_even(row, suffix):
    designs, (low, high) = row[f"break_even_{suffix}"], row[f"break_even_{suffix}_interval"]
    if designs is None:
        return "never"
    low, high = ("never" if end is None else f"{end:.1f}" for end in (low, high))
    return f"{designs:.1f} ({low} to {high})"


def _error(row):
    if row["drag_error_mean"] is None:
        return ""
    return f"{100 * row['drag_error_mean']:.3f} / {100 * row['drag_error_max']:.2f} %"


def _from(designs):
    return "never" if designs is None else f"from design {designs}"
