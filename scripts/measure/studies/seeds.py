"""Trainings on few bodies, seed by seed: errors, work, and the time of the fit alone."""

import dataclasses
from collections.abc import Iterator

from studies.gradients import adjoint_slopes
from studies.training import GRADIENTS, Truth, learned, shrunk, timed_fit
from study import Row, Run, Study, Table, columns

from surrogate import Flow
from surrogate.training.loop import make_setup
from surrogate.training.plan import make_plan
from surrogate.training.record import surrogate_of


def cases(run: Run) -> Iterator[Row]:
    for seed in (0, 1, 2):
        for bodies in (64, 256):
            for method in ("hig", "sip"):
                yield {"seed": seed, "bodies": bodies, "method": method}


def measure(run: Run, seed: int, bodies: int, method: str) -> Row:
    """Train, and time the steps once all flows are known."""
    plan = dataclasses.replace(make_plan(None, method, "full", bodies, seed), report_every=20)
    plan = shrunk(plan) if run.tiny else plan
    setup = make_setup(plan)
    trained, fit = timed_fit(plan, setup)
    slopes = adjoint_slopes(Flow(plan.scene), setup.held_out.head(GRADIENTS))
    truth = Truth(setup.held_out, setup.labels, slopes)
    return {"fit_s": fit} | learned(truth, surrogate_of(plan, trained, setup))


COLUMNS = "method {method} | bodies {bodies} | seed {seed} | mean error {error_mean:.3%}"
COLUMNS += " | largest {error_max:.2%} | gradient {gradient:.1%} | G {green_applications}"
STUDY = Study([Table(cases, measure, columns(f"{COLUMNS} | CPU seconds of the fit {{fit_s:.1f}}"))])
