"""Which safeguards of the trainings matter: the quick one, one thing changed at a time.

python scripts/measure/safeguards.py
"""

import dataclasses
import sys
from collections.abc import Callable
from typing import Any

from study import Result, Study, run_study, table_of_rows
from training import attempt, shrunk

from surrogate.training.loop import make_setup
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


def measure(tiny: bool, progress: Callable) -> Result:
    """Train every variant from the same weights on the same bodies."""
    variants = [(m, name, kw) for m, group in VARIANTS.items() for name, kw in group.items()]
    variants = variants[-1:] if tiny else variants
    bench, rows = None, []
    for k, (method, name, settings) in enumerate(variants):
        progress(k / len(variants), f"{method}, {name}")
        plan = make_plan(None, method, "quick")
        plan = dataclasses.replace(plan, report_every=1)
        plan = shrunk(plan) if tiny else plan
        bench = bench or make_setup(plan)
        found = attempt(plan, bench, MAKERS[method](**settings))
        rows.append({"method": method, "variant": name} | found)
    return {"rows": rows}


HEADS = "method | variant | mean | max | applications of G | left out | outcome"
FORMS = "{method} | {variant} | {mean:.2%} | {max:.2%} | {work} | {failed} | {outcome}"
STUDY = Study("safeguards", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
