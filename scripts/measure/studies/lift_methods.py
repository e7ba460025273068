"""The training methods with three loads, at their best and as published, by the same clock.

Studies ``lift_trainings`` and ``particle_trainings`` have SIP and DP at their best, trained to
their end; ``three_loads_lift`` and ``three_loads`` have HIG and supervised regression on the same
bodies.
"""

import dataclasses
import functools
from pathlib import Path

from solved_flows import CELLS, HELD_OUT, scene_of
from studies.three_loads import mean_and_largest
from study import Result, Row, Run, Study, Table, cases, columns

from surrogate import NotConverged
from surrogate.training.loop import TrainingResult, load_errors, run_training
from surrogate.training.plan import METHODS, Plan, make_plan
from surrogate.training.setup import TrainingSetup, make_setup
from surrogate.training.train import train_plan

SAMPLES = 64
SECONDS = {"lift": 300.0, "particle": 90.0}  # in 2-D all methods at their best end before
SIZES = {"lift": (64, 256, 1024, 4096), "particle": (64,)}  # of trainings to their end
METHODS_TWICE = cases(published=(False, True), method=METHODS)


def plan_of(run: Run, name: str, method: str, published: bool = False) -> Plan:
    """Return the plan of a training, which ends when its time is over."""
    samples, held_out = run.pick((8, 4), (SAMPLES, HELD_OUT[name]))
    scene = scene_of(name, run.tiny)
    plan = make_plan(scene, method, "full", samples, 0, SECONDS[name], published, held_out)
    return dataclasses.replace(plan, iterations=2, report_every=1) if run.tiny else plan


@functools.lru_cache(maxsize=1)
def setup_of(run: Run, name: str) -> TrainingSetup:
    """Return the setup that all methods share."""
    return make_setup(plan_of(run, name, METHODS[0]))


def measure(run: Run, scene: str, method: str, published: bool) -> Row:
    """Return the errors over Cd of a training on held-out bodies, its steps, work and time.

    Args:
      run: How the study is run.
      scene: Its name.
      method: Of the training.
      published: Whether as published, instead of at its best.
    """
    setup = setup_of(run, scene)
    row = {"kind": "as published" if published else "at its best"}
    try:
        found = run_training(plan_of(run, scene, method, published), setup)
    except NotConverged as problem:
        return row | {"outcome": str(problem)}
    return row | _learned(found, setup)


def trained_to_its_end(run: Run, scene: str, bodies: int, method: str) -> Row:
    """Return the errors over Cd of a method at its best, with all its steps, and their work.

    Trainings are kept in ``--surrogates``: one that was interrupted goes on, in later runs too.

    Args:
      run: How the study is run.
      scene: Its name.
      bodies: Number of training bodies.
      method: Of the training.
    """
    samples, held_out = run.pick((8, 4), (bodies, HELD_OUT[scene]))
    plan = make_plan(scene_of(scene, run.tiny), method, "full", samples, held_out=held_out)
    plan = dataclasses.replace(plan, iterations=2) if run.tiny else plan
    folder = None if run.tiny else run.options["surrogates"] / f"{method}-{bodies}"
    record = train_plan(plan, folder).record
    steps, seconds, work, *_ = record["history"][-1]
    row = {"outcome": record["stopped"] or "trained", "steps": steps, "work": work}
    row |= {"seconds": seconds}
    for key, load in (("cd", "drag"), ("cl", "lift"), ("cm", "moment")):
        row |= {key: record[f"{load}_error_mean"], f"{key}_most": record[f"{load}_error_max"]}
    return row


def _learned(found: TrainingResult, setup: TrainingSetup) -> Row:
    """Outcome, steps, work and time of a training, and its errors over Cd on held-out bodies."""
    errors, last = load_errors(found.network, setup.held_out, setup.labels.loads), found.history[-1]
    row = {"outcome": found.stopped or "trained", "steps": last.iteration}
    row |= {"work": last.green_applications, "seconds": last.seconds}
    return row | mean_and_largest(errors)


def untrained(run: Run, result: Result) -> Result:
    """Return the mean errors of the initial network, from which all start."""
    setup = setup_of(run, result["rows"][0]["scene"])
    errors = load_errors(setup.network, setup.held_out, setup.labels.loads)
    return {"untrained": [float(mean) for mean in errors.mean(axis=0)]}


def text(result: Result) -> str:
    """Return the mean errors before any training as a sentence."""
    cd, cl, cm = (100 * error for error in result["untrained"])
    return f"Untrained, the network errs by {cd:.0f}, {cl:.0f} and {cm:.0f} % of Cd on average."


LEARNED = (
    " | error over Cd, mean and largest: Cd {cd:.3%}"
    " | {cd_most:.2%} | Cl {cl:.3%} | {cl_most:.2%} | Cm {cm:.3%} | {cm_most:.2%}"
    " | steps {steps} | G {work:,} | seconds {seconds:.0f} | outcome {outcome}"
)
COLUMNS = columns("method {method} | settings {kind}" + LEARNED)
TO_THE_END = columns("method {method} | bodies {bodies}" + LEARNED)


def by_the_clock(scene: str) -> Study:
    """Return the study of trainings that end when their time is over."""
    each = [{"scene": scene} | case for case in METHODS_TWICE]
    return Study([Table(each, measure, COLUMNS)], text, untrained)


def to_their_end(scene: str) -> Study:
    """Return the study of trainings with all their steps."""
    each = [{"scene": scene} | case for case in cases(bodies=SIZES[scene], method=("sip", "dp"))]
    folder = {
        "type": Path,
        "default": Path(f"out/{scene}_trainings"),
        "help": "folder of trainings",
    }
    return Study([Table(each, trained_to_its_end, TO_THE_END)], options={"--surrogates": folder})


STUDIES = {f"{scene}_methods": by_the_clock(scene) for scene in CELLS}
STUDIES |= {f"{scene}_trainings": to_their_end(scene) for scene in CELLS}
