"""Which safeguards of the trainings matter: the quick training with one setting changed."""

import dataclasses
from collections.abc import Iterator
from typing import Any

from studies.training import attempt, shrunk
from study import Row, Run, Study, Table, columns

from surrogate.training.plan import MAKERS, make_plan

VARIANTS: dict[str, dict[str, dict[str, Any]]] = {
    "hig": {
        "as shipped": {},
        "no truncation (tau 0)": {"tau": 0.0},
        "tau 1e-3": {"tau": 1e-3},
        "Gauss-Newton (kappa 1)": {"kappa": 1.0, "tau": 1e-2},
        "half steps (eta 0.5)": {"eta": 0.5},
        "triple steps (eta 3)": {"eta": 3.0},
        "fast decay (8)": {"decay": 8.0},
        "small batches (16)": {"batch": 16},
    },
    "dp": {"as shipped": {}, "no slopes": {"slopes": 0.0}, "small batches (16)": {"batch": 16}},
    "sip": {
        "one network step per inversion": {"network_steps": 1},
        "no slopes": {"slopes": 0.0},
        "the whole traction too": {"modes": 1.0},
        "as shipped": {},
    },
}


def cases(run: Run) -> Iterator[Row]:
    for method, variants in VARIANTS.items():
        for variant, settings in variants.items():
            yield {"method": method, "variant": variant, "settings": settings}


def measure(run, method, settings, **_) -> Row:
    """Train from the same weights on the same bodies."""
    plan = dataclasses.replace(make_plan(None, method, "quick"), report_every=1)
    return attempt(run.pick(shrunk, lambda plan: plan)(plan), MAKERS[method](**settings))


COLUMNS = "method {method} | variant {variant} | mean error {mean:.2%} | largest {max:.2%}"
COLUMNS += " | G {work} | samples left out {failed} | outcome {outcome}"
STUDY = Study([Table(cases, measure, columns(COLUMNS), tiny="last")])
