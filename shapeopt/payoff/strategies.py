"""All ways to answer a stream of queries, each to the flow's own optimum."""

import time
from collections.abc import Callable, Sequence

from shapeopt.payoff.break_even import Cost, Strategy
from shapeopt.payoff.direct import design_directly, nearest_answer
from shapeopt.problem.problem import Problem
from shapeopt.search.design import Design
from shapeopt.search.designer import Designer
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate
from surrogate.progress import progress_bar

Answer = Callable[[Problem], Design]


def rivals(queries: list[Problem], flow: Flow) -> list[Strategy]:
    """What trains nothing: SLSQP afresh, SLSQP from the nearest answer, and growing kriging."""
    answered: list[Design] = []

    def warm(problem):
        answered.append(design_directly(problem, flow, nearest_answer(problem, answered)))
        return answered[-1]

    growing = Designer(flow)
    return [
        _way("direct", queries, lambda problem: design_directly(problem, flow)),
        _way("direct, from the nearest answer", queries, warm, remembers=True),
        _way("growing kriging", queries, growing.design, remembers=True),
    ]


def trained(name: str, queries: list[Problem], surrogates: Sequence[Surrogate]) -> Strategy:
    """A network, one a seed, corrected for every query afresh: its worth as it was trained."""
    return _of_seeds(name, queries, surrogates, lambda s: lambda q: Designer(s).design(q), False)


def remembering(name: str, queries: list[Problem], surrogates: Sequence[Surrogate]) -> Strategy:
    """A network whose discrepancy is kept from query to query."""
    return _of_seeds(name, queries, surrogates, lambda s: Designer(s).design, True)


def _of_seeds(name, queries, surrogates, make, remembers):
    ways = [_way(name, queries, make(surrogate), remembers) for surrogate in surrogates]
    records = [surrogate.record for surrogate in surrogates]
    return Strategy(
        name,
        [Cost(r["train_s"] + r["setup_s"], r["green_applications"]) for r in records],
        [way.designs[0] for way in ways],
        remembers,
        sum(r["drag_error_mean"] for r in records) / len(records),
        max(r["drag_error_max"] for r in records),
    )


def _way(name: str, queries: list[Problem], answer: Answer, remembers: bool = False) -> Strategy:
    designs = []
    with progress_bar(f"designs: {name}") as progress:
        for k, problem in enumerate(queries):
            designs.append(answer(problem))
            progress((k + 1) / len(queries), f"{k + 1} of {len(queries)} queries")
    return Strategy(name, [Cost()], [designs], remembers)


def compile_all(queries: list[Problem], flow: Flow, surrogate: Surrogate) -> float:
    """Seconds of compiling what designs need, which is no part of any design's cost.

    All queries are answered twice by the growing kriging, which compiles anew as it grows; what
    the first time took longer was compilation.
    """
    first, second = (_seconds(Designer(flow), queries) for _ in range(2))
    return first - second + _seconds(Designer(surrogate), queries[:1])


def _seconds(designer, queries):
    start = time.perf_counter()
    for problem in queries:
        designer.design(problem)
    return time.perf_counter() - start
