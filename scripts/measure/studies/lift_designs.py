"""Designs with lift: flows and work of each strategy, and when the training pays."""

import numpy as np
from study import TINY, Result, Row, Run, Study, Table, columns

from shapeopt import Designer, Glide, Problem
from shapeopt.payoff.break_even import LATE, break_even, resampled_break_even
from shapeopt.payoff.direct import design_directly
from shapeopt.payoff.queries import query_stream
from shapeopt.search.design import Design
from surrogate import Family, Flow, NotConverged, Scene, load
from surrogate.model.surrogate import LOAD_NAMES

NAME = "pretrained:lift"
LED, GROWING, DIRECT = "the network", "kriging with memory", "direct"
QUERIES, SEED = 20, 3
FAR = 0.01  # relative excess over the best known objective that counts as another optimum


def _queries(run: Run) -> list[Problem]:
    return query_stream(_scene(run), SEED, run.pick(2, QUERIES))


def _scene(run: Run) -> Scene:
    if not run.tiny:
        return load(NAME).scene
    family = Family(aspect=(2.0, 2.2), incidence=(0.0, 10.0))
    return Scene(reynolds=(5.0, 8.0), family=family, fidelity=TINY)


def one_at_a_time(run: Run, query: int, strategy: str) -> Row:
    """Return the design of a query by a strategy that forgets its flows afterwards."""
    problem = _queries(run)[query]
    if strategy == DIRECT:
        return _answer(problem, lambda: design_directly(problem, Flow(problem.scene)))
    model = Flow(problem.scene) if run.tiny else load(NAME)
    return _answer(problem, lambda: Designer(model).design(problem))


def in_a_row(run: Run, strategy: str) -> list[Row]:
    """Return the designs of all queries by kriging with memory."""
    queries, rows = _queries(run), []
    designer = Designer(Flow(_scene(run)))
    for k, problem in enumerate(queries):
        run.progress(k / len(queries), f"query {k + 1} of {len(queries)}")
        rows.append(_answer(problem, lambda one=problem: designer.design(one)) | {"query": k})
    return rows


def _answer(problem: Problem, solve) -> Row:
    glide = isinstance(problem.objective, Glide)
    asked = "glide ratio" if glide else f"Cl {problem.lift:.2f}"
    row = {"asked": asked, "reynolds": problem.objective.nominal, "problem": None}
    row |= {"max_length": problem.max_length, "min_thickness": problem.min_thickness}
    try:
        design: Design = solve()
    except NotConverged as reason:
        return row | {"problem": str(reason)}
    return row | {
        "objective": design.objective,
        "cd": design.drag,
        "cl": design.lift,
        "flows": design.flows,
        "green_applications": design.green_applications,
        "kkt": design.kkt_residual,
        "seconds": design.seconds,
    }


def training(run: Run, _: Result) -> Result:
    """Return the work of the training that made the network, and its held-out errors."""
    record = load(NAME).record
    errors = [[record[f"{name}_error_{of}"] for name in LOAD_NAMES] for of in ("mean", "max")]
    return {
        "training_g": record["green_applications"] + record["earlier_green_applications"],
        "bodies": record["samples"],
        "error_mean": errors[0],
        "error_max": max(errors[1]),
    }


def when_to_train(result: Result) -> str:
    """Return the README's sentence on what training gains in a scene with lift."""
    lines = {line["strategy"]: line for line in strategies(result)}
    led, growing, direct = lines[LED], lines[GROWING], lines[DIRECT]
    after, own, late = _late(result)
    return (
        f"Sections at incidence, {led['asked']} queries (least drag at a lift, best glide ratio): "
        f"{led['flows']:.1f} flows led by `{NAME}` ({result['bodies']:,} bodies), "
        f"{growing['flows']:.1f} by kriging with memory, {direct['flows']:.1f} by `direct`, which "
        f"ends over {100 * FAR:g} % above the best optimum in {direct['far']}. Training pays "
        f"against `direct` {_pays(result)}; against kriging with memory it {_in_words(after)} "
        f"(last {LATE} designs: {late:.0f} G, the network's {own:.0f} G)."
    )


def text(result: Result) -> str:
    """Return the strategies over all queries, and from which design the training pays."""
    work = (
        f"The training of {NAME} on {result['bodies']:,} sections took {result['training_g']:,} "
        "convolutions (G)."
    )
    by_network = LED_ROWS([row for row in result["rows"] if row["problem"] is None])
    table, (after, own, late) = STRATEGIES(strategies(result)), _late(result)
    return (
        f"{table}\n\n{work} By mean costs it pays against `direct` {_pays(result)}, in brackets "
        f"the 95 % interval. Kriging with memory takes {late:.0f} G for each of the last {LATE} "
        f"designs, and the network {own:.0f} G: against it training {_in_words(after)}.\n\n"
        f"{by_network}"
    )


def _pays(result):
    """Return, in words, after how many designs the training pays against ``direct``."""
    saved = _work(result, "direct") - _work(result, "rows")
    found = resampled_break_even(np.array([result["training_g"]], float), saved[None])
    if not np.isfinite(found.designs):
        return "never"
    high = f"{found.high:.0f}" if np.isfinite(found.high) else "never"
    return f"after {found.designs:.0f} designs ({found.low:.0f} to {high})"


def _in_words(after):
    return f"pays after {after:.0f} designs" if np.isfinite(after) else "does not pay"


def _late(result):
    """Return when training pays by the last designs' costs, and theirs: led, and by kriging."""
    own, late = (_work(result, key)[-LATE:].mean() for key in ("rows", "growing"))
    return break_even(result["training_g"], own, late), own, late


def _work(result, key):
    """Return the convolutions of a strategy's designs, query by query, of those that all found."""
    rows = [result[name] for name in ("rows", "growing", "direct")]
    lost = {row["query"] for each in rows for row in each if row["problem"] is not None}
    kept = sorted(
        (row["query"], row["green_applications"]) for row in result[key] if row["query"] not in lost
    )
    return np.array([work for _, work in kept], float)


def strategies(result: Result) -> list[Row]:
    """Return a row for each strategy over all queries: flows, work, KKT residuals and gaps.

    A gap is the excess of the objective over the best known one.
    """
    each = result["rows"] + result["growing"] + result["direct"]
    found = [row for row in each if row["problem"] is None]
    best = {q: min(r["objective"] for r in found if r["query"] == q) for q in _numbers(found)}
    asked, lines = [row["strategy"] for row in each], []
    for strategy in [name for name in (LED, GROWING, DIRECT) if name in asked]:
        mine = [row for row in found if row["strategy"] == strategy]
        gaps = [(r["objective"] - best[r["query"]]) / abs(best[r["query"]]) for r in mine]
        lines.append(
            {
                "strategy": strategy,
                "asked": asked.count(strategy),
                "found": len(mine),
                "flows": np.mean([row["flows"] for row in mine]),
                "most": max(row["flows"] for row in mine),
                "work": np.mean([row["green_applications"] for row in mine]),
                "kkt": max(row["kkt"] for row in mine),
                "gap": max(gaps),
                "far": sum(gap > FAR for gap in gaps),
            }
        )
    return lines


def _numbers(rows: list[Row]) -> list[int]:
    return sorted({row["query"] for row in rows})


STRATEGIES = columns(
    "strategy {strategy} | queries {asked} | found {found} | flows a design {flows:.2f}"
    " | most {most} | G a design {work:.0f} | largest KKT residual {kkt:.0e}"
    " | objective above the best known, at most {gap:.3%} | by more than 1 % in {far}"
)
LED_ROWS = columns(
    "query {query} | asked {asked} | Re {reynolds:.3g} | Cd {cd:.4f} | Cl {cl:.4f} | flows {flows}"
    " | work {green_applications} G | KKT residual {kkt:.0e}"
)
TABLES = [
    Table([{"query": k, "strategy": LED} for k in range(QUERIES)], one_at_a_time),
    Table([{"strategy": GROWING}], in_a_row, key="growing"),
    Table([{"query": k, "strategy": DIRECT} for k in range(QUERIES)], one_at_a_time, key="direct"),
]
STUDIES = {"lift_designs": Study(TABLES, text, training)}
