"""Designs with lift: flows and work of each strategy, and when the training pays."""

import contextlib
from collections.abc import Callable

import numpy as np
from study import TINY, Result, Row, Run, Study, Table, columns

from shapeopt import Designer, Glide, Problem
from shapeopt.payoff.break_even import LATE, MOST_DESIGNS, break_even, resampled_break_even
from shapeopt.payoff.direct import design_directly
from shapeopt.payoff.queries import query_stream
from shapeopt.problem.conflicts import candidates
from shapeopt.search.design import Design
from shapeopt.search.evaluated import starting_body
from surrogate import Family, Flow, NotConverged, Scene, family_shape, load
from surrogate.scene.limits import onset_of

NAME = "pretrained:lift"
LED, GROWING, DIRECT = "the network", "kriging with memory", "direct"
QUERIES, SEED = 20, 3
FAR = 0.01  # relative excess over the best known objective that counts as another optimum
STARTS = 16  # of ``direct`` at most
ENOUGH = 30_000  # convolutions with G, after which ``direct`` does not start again


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

    def led(one):
        return [Designer(Flow(one.scene) if run.tiny else load(NAME)).design(one)]

    def direct(one):
        return directly_as_good(one, led(one)[0].objective, query)

    return _answer(problem, led if strategy == LED else direct)


def directly_as_good(problem: Problem, target: float, seed: int) -> list[Design]:
    """Return the designs of ``direct``, one from each body where it starts.

    It starts again, from a random feasible body, while its best objective is more than ``FAR``
    above ``target``, which an engineer does not know, and less than ``ENOUGH`` convolutions were
    spent. Starts that fail are left out.

    Raises:
      NotConverged: all of them fail.
    """
    flow, rng = Flow(problem.scene), np.random.default_rng(seed)
    starts = [starting_body(problem), *rng.choice(candidates(problem), STARTS - 1)]
    designs: list[Design] = []
    for start in starts:
        with contextlib.suppress(NotConverged):
            designs.append(design_directly(problem, flow, start))
        best = min((one.objective for one in designs), default=np.inf)
        spent = sum(one.green_applications for one in designs)
        if best - target <= FAR * abs(target) or spent > ENOUGH:
            break
    if not designs:
        raise NotConverged(f"SLSQP on the flow: from none of {len(starts)} bodies")
    return designs


def in_a_row(run: Run, strategy: str) -> list[Row]:
    """Return the designs of all queries by kriging with memory."""
    queries, rows = _queries(run), []
    designer = Designer(Flow(_scene(run)))
    for k, problem in enumerate(queries):
        run.progress(k / len(queries), f"query {k + 1} of {len(queries)}")
        rows.append(_answer(problem, lambda one: [designer.design(one)]) | {"query": k})
    return rows


def _answer(problem: Problem, solve: Callable[[Problem], list[Design]]) -> Row:
    """Return the best of the designs found for a problem, with the work of all."""
    row = {"asked": _asked(problem), "reynolds": problem.objective.nominal, "problem": None}
    row |= {"max_length": problem.max_length, "min_thickness": problem.min_thickness}
    try:
        designs = solve(problem)
    except NotConverged as reason:
        return row | {"problem": str(reason)}
    best = min(designs, key=lambda design: design.objective)
    work = {
        name: sum(getattr(design, name) for design in designs)
        for name in ("flows", "green_applications", "seconds")
    }
    body = problem.scene.family.named(best.parameters)
    loads = {"cd": best.drag, "cl": best.lift, "cm": best.moment}
    loads |= {"parameters": body}
    found = {"objective": best.objective, "kkt": best.kkt_residual, "starts": len(designs)}
    return row | found | loads | work


def _asked(problem: Problem) -> str:
    """Return what a problem asks for, in words."""
    glide = isinstance(problem.objective, Glide)
    words = ["glide ratio" if glide else f"Cl {problem.lift:.2f}"]
    if problem.within:
        words.append(f"at {problem.within['incidence'][0]:.1f} degrees")
    if problem.max_moment is not None:
        words.append(f"Cm at most {problem.max_moment:.2f}")
    return ", ".join(words)


def training(run: Run, _: Result) -> Result:
    """Return the work of the training that made the network."""
    record = load(NAME).record
    return {
        "training_g": record["green_applications"] + record["earlier_green_applications"],
        "bodies": record["samples"],
    }


def when_to_train(result: Result) -> str:
    """Return the README's sentence on what training gains in a scene with lift."""
    lines = {line["strategy"]: line for line in strategies(result)}
    led, growing, direct = lines[LED], lines[GROWING], lines[DIRECT]
    return (
        f"Sections at incidence, {led['asked']} queries: "
        f"{led['flows']:.2f} flows led by `{NAME}` ({result['bodies']:,} bodies), "
        f"{growing['flows']:.1f} by kriging, {direct['flows']:.1f} by `direct` (in "
        f"{direct['far']} worse by {100 * direct['gap']:.1f} %). By G "
        f"training pays against `direct` {_pays(result)}."
    )


def over_kriging(result: Result) -> float:
    """Return after how many designs the training pays against kriging with memory, by G."""
    return _late(result)[0]


def text(result: Result) -> str:
    """Return the strategies over all queries, and from which design the training pays."""
    work = (
        f"The training of {NAME} on {result['bodies']:,} sections took {result['training_g']:,} "
        "convolutions (G)."
    )
    rows = [
        row | {"onset": onset_of(family_shape(row["parameters"]))}
        for row in result["rows"]
        if row["problem"] is None
    ]
    unsteady = sum(row["reynolds"] > row["onset"] for row in rows)
    (after, own, late), lines = _late(result), strategies(result)
    mean = {line["strategy"]: line["work"] for line in lines}
    return (
        f"{STRATEGIES(lines)}\n\n{work} By mean costs it pays against `direct` {_pays(result)}, in "
        f"brackets the 95 % interval; by the costs of the last {LATE} designs against kriging with "
        f"memory {_in_words(after)}: that takes {mean[GROWING]:.0f} G a design, {late:.0f} in the "
        f"last {LATE}, and the network {mean[LED]:.0f} and {own:.0f}. `direct` starts at most "
        f"{STARTS} times, and not again after {ENOUGH:,} G. "
        f"{unsteady} of the network's {len(rows)} optima are steady flows beyond the estimated "
        "onset of instability.\n\n"
        f"{LED_ROWS(rows)}"
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
    known = after <= MOST_DESIGNS
    return f"after {after:.0f} designs" if known else f"not within {MOST_DESIGNS:,}"


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
                "middle": np.median([row["green_applications"] for row in mine]),
                "kkt": max(row["kkt"] for row in mine),
                "gap": max(gaps),
                "far": sum(gap > FAR for gap in gaps),
                "restarted": sum(row["starts"] > 1 for row in mine),
            }
        )
    return lines


def _numbers(rows: list[Row]) -> list[int]:
    return sorted({row["query"] for row in rows})


STRATEGIES = columns(
    "strategy {strategy} | queries {asked} | found {found} | flows a design {flows:.2f}"
    " | most {most} | G a design, mean {work:.0f} | median {middle:.0f}"
    " | largest KKT residual {kkt:.0e}"
    " | objective above the best known, at most {gap:.3%}"
    f" | by more than {100 * FAR:g} % in {{far}} | started again in {{restarted}}"
)
LED_ROWS = columns(
    "query {query} | asked {asked} | Re {reynolds:.3g} | onset Re {onset:.3g} | Cd {cd:.4f}"
    " | Cl {cl:.4f} | Cm {cm:.4f} | flows {flows} | work {green_applications} G"
    " | KKT residual {kkt:.0e}"
)
TABLES = [
    Table([{"query": k, "strategy": LED} for k in range(QUERIES)], one_at_a_time),
    Table([{"strategy": GROWING}], in_a_row, key="growing"),
    Table([{"query": k, "strategy": DIRECT} for k in range(QUERIES)], one_at_a_time, key="direct"),
]
STUDIES = {"lift_designs": Study(TABLES, text, training)}
