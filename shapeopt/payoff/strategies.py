"""The strategies that answer a stream of queries, each up to an optimum of the flow."""

import contextlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax

from shapeopt.payoff.break_even import Cost, Strategy
from shapeopt.payoff.direct import design_directly, nearest_design
from shapeopt.problem.problem import Problem
from shapeopt.search.design import Design
from shapeopt.search.designer import Designer
from surrogate.errors import NotConverged
from surrogate.flow.flow import Flow
from surrogate.flow.streams import forget_operators
from surrogate.model.surrogate import Surrogate
from surrogate.progress import progress_bar

MOST_UNANSWERED = 0.1  # share of the queries that may be left out of a comparison; one always may

Queries = Sequence[Problem]
Solve = Callable[[Problem], Design]


class Unanswered(NamedTuple):
    """The index of a query, a strategy that did not answer it, and why it did not."""

    query: int
    strategy: str
    reason: str


def comparable(strategies: Sequence[Strategy]) -> tuple[list[Strategy], list[Unanswered]]:
    """Return strategies with the answers to those queries that every strategy has answered.

    Args:
      strategies: with their answers to the same queries.

    Returns:
      The strategies without the other queries, and who did not answer these.

    Raises:
      NotConverged: more than a tenth of the queries, at least two, or all of them would be left
        out.
    """
    missing = [
        Unanswered(k, strategy.name, str(answer))
        for strategy in strategies
        for row in strategy.designs
        for k, answer in enumerate(row)
        if isinstance(answer, NotConverged)
    ]
    left_out, count = {one.query for one in missing}, len(strategies[0].designs[0])
    if len(left_out) > max(1, MOST_UNANSWERED * count) or len(left_out) == count:
        raise NotConverged(
            f"designs: {len(left_out)} of {count} queries were not answered by every strategy, at "
            f"most a tenth may be left out; query {missing[0].query + 1} by "
            f"{missing[0].strategy}: {missing[0].reason}; what is trained is kept"
        )
    return [strategy.without(left_out) for strategy in strategies], missing


def rivals(queries: Queries, flow: Flow) -> list[Strategy]:
    """Return the three strategies without training, with their answers to all queries.

    They are SLSQP from the same body, SLSQP from the nearest design so far, and kriging with
    memory: the managed search without a network, which keeps its flows.
    """
    found: list[Design] = []

    def solve_from_nearest(problem):
        found.append(design_directly(problem, flow, nearest_design(problem, found)))
        return found[-1]

    kriging = Designer(flow)
    return [
        _answer("direct", queries, lambda problem: design_directly(problem, flow)),
        _answer("direct, from the nearest answer", queries, solve_from_nearest, True),
        _answer("kriging with memory", queries, kriging.design, True),
    ]


def trained(name: str, queries: Queries, surrogates: Sequence[Surrogate]) -> Strategy:
    """Return the strategy of a network per seed whose correction is forgotten after each query."""
    return _of_seeds(name, queries, surrogates, lambda s: lambda q: Designer(s).design(q), False)


def trained_with_memory(name: str, queries: Queries, surrogates: Sequence[Surrogate]) -> Strategy:
    """Return the strategy of a network per seed whose correction is kept from query to query."""
    return _of_seeds(name, queries, surrogates, lambda s: Designer(s).design, True)


def _of_seeds(
    name: str,
    queries: Queries,
    surrogates: Sequence[Surrogate],
    make_solve: Callable[[Surrogate], Solve],
    keeps_flows: bool,
) -> Strategy:
    records = [surrogate.record for surrogate in surrogates]
    return Strategy(
        name,
        [Cost(r["train_s"] + r["setup_s"], r["green_applications"]) for r in records],
        [_designs(name, queries, make_solve(surrogate)) for surrogate in surrogates],
        keeps_flows,
        sum(r["drag_error_mean"] for r in records) / len(records),
        max(r["drag_error_max"] for r in records),
    )


def _answer(name: str, queries: Queries, solve: Solve, keeps_flows: bool = False) -> Strategy:
    return Strategy(name, [Cost()], [_designs(name, queries, solve)], keeps_flows)


def _designs(name: str, queries: Queries, solve: Solve) -> list[Design | NotConverged]:
    answers: list[Design | NotConverged] = []
    with progress_bar(f"designs: {name}") as progress:
        for k, problem in enumerate(queries):
            forget_operators()  # of the strategies before
            try:
                answers.append(solve(problem))
            except NotConverged as reason:
                answers.append(reason)
            progress((k + 1) / len(queries), f"{k + 1} of {len(queries)} queries")
    return answers


def compile_all(queries: Queries, flow: Flow, surrogate: Surrogate) -> None:
    """Compile what designs need, so that no design's cost includes it.

    Programs depend on the number of flows that kriging keeps and on which bounds a query has. So
    all queries are answered by kriging with memory, without and with the surrogate, and one query
    of each set of bounds by the surrogate alone.
    """
    bounds = {jax.tree.structure(problem.limits): problem for problem in queries}
    keeping = Designer(flow), Designer(surrogate)
    designs = [(designer, problem) for designer in keeping for problem in queries]
    designs += [(Designer(surrogate), problem) for problem in bounds.values()]
    with progress_bar("compiling") as progress:
        for k, (designer, problem) in enumerate(designs):
            with contextlib.suppress(NotConverged):
                designer.design(problem)
            progress((k + 1) / len(designs), f"{k + 1} of {len(designs)} designs")
