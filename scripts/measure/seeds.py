"""Trainings on few bodies, seed by seed: errors, work, and what the fit alone takes.

python scripts/measure/seeds.py
"""

import dataclasses
import sys
from collections.abc import Callable
from typing import Any

from gradients import adjoint_slopes
from study import Result, Study, run_study, table_of_rows
from training import GRADIENTS, Truth, learned, shrunk, timed_fit

from surrogate import Flow
from surrogate.training.loop import make_setup
from surrogate.training.plan import make_plan
from surrogate.training.record import surrogate_of

SEEDS, COUNTS, METHODS = (0, 1, 2), (64, 256), ("hig", "sip")


def measure(tiny: bool, progress: Callable) -> Result:
    """Train every one, time the steps once all flows are known."""
    jobs = [(s, c, m) for s in SEEDS for c in COUNTS for m in METHODS][-1 if tiny else None :]
    rows: list[dict[str, Any]] = []
    for k, (seed, count, method) in enumerate(jobs):
        progress(k / len(jobs), f"seed {seed}, {count} bodies, {method}")
        plan = dataclasses.replace(make_plan(None, method, "full", count, seed), report_every=20)
        plan = shrunk(plan) if tiny else plan
        bench = make_setup(plan)
        trained, fit = timed_fit(plan, bench)
        flow, unseen = Flow(plan.scene), bench.held_out
        slopes = adjoint_slopes(flow, unseen.head(GRADIENTS))
        surrogate = surrogate_of(plan, trained, bench)
        found = learned(Truth(unseen, bench.labels, slopes), surrogate)
        rows.append({"seed": seed, "bodies": count, "method": method, "fit_s": fit} | found)
    return {"rows": rows}


HEADS = "method | bodies | seed | mean | max | gradient | G | CPU seconds of the fit"
FORMS = "{method} | {bodies} | {seed} | {error_mean:.3%} | {error_max:.2%} | {gradient:.1%} | "
FORMS += "{green_applications} | {fit_s:.1f}"
STUDY = Study("seeds", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
