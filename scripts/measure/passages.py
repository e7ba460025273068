"""The passages of the README that state measurements, written from the records in results/."""

import json
import math
from collections.abc import Callable
from pathlib import Path

from run import RESULTS
from studies import (
    accelerator,
    far_field,
    fit_memory,
    lift_designs,
    onset_2d,
    particle,
    random_sections,
    section_designs,
    training,
)
from study import Result, words
from tools import LOADS, mean_and_most

from shapeopt.payoff.break_even import LATE, MOST_DESIGNS
from shapeopt.payoff.tables import SHOWN_DESIGNS, short_table
from surrogate import load

SHIPPED = "pretrained", "pretrained:space", "pretrained:lift", "pretrained:particle"


def passage(name: str, folder: Path = RESULTS) -> str:
    """Return a passage of the README by the name of its block; empty where a record is missing."""

    def result(study: str) -> Result:
        return json.loads((folder / f"{study}.json").read_text())["result"]

    try:
        return PASSAGES[name](result)
    except FileNotFoundError:
        return ""


def duration(result: Callable[[str], Result]) -> str:
    """Return how long the first command takes, and what a GPU gains."""
    form = (
        "It takes {least:.0f} to {most:.0f} minutes on two cores with the install. A GPU "
        '({device}; `pip install "jax[cuda13]"`) solves batches of 2-D flows {gain:.0f} times as '
        "fast as one JAX CPU device."
    )
    least, most = (seconds / 60 for seconds in result("duration")["seconds"])
    most = math.ceil(most)
    gain = accelerator.gain(result("accelerator"), "2-D, standard")
    return words(form, least=least, most=most, **gain)


def payoff(result: Callable[[str], Result]) -> str:
    """Return the table of strategies, with the errors of rivals that are fitted to flows."""
    form = (
        "Means of {count} designs, local optima of the flow (`{worst}` up to {far:.2f} % above "
        "the least drag found, others {gap:.2f} %); trainings on {bodies} bodies unless said; "
        "brackets: 95 % intervals. By "
        "wall clock `hig` pays against `direct` after {after[hig]:.0f} designs, `hig, 64 bodies` "
        "after {after[hig, 64 bodies]:.0f}. Fitted to as many flows, kriging errs by "
        "{off[gradient-enhanced kriging]} with gradients, {off[kriging]} without, a polynomial by "
        "{off[polynomial]}. As in their papers, without gradients: SIP "
        "{off[sip, as published]:.3%}, HIG {off[hig, as published]:.3%}, DP "
        "{off[dp, as published]:.3%}."
    )
    rows = result("payoff")["payoff"]
    after = {row["method"]: row["break_even_s"] for row in rows}
    off = {row["method"]: row["error_mean"] for row in training.summary(result("training"))}
    off |= {row["method"]: row["drag_error_mean"] for row in rows if row["training_g"]}
    count, bodies = len(result("payoff")["queries"]), result("payoff")["settings"]["samples"]
    *_, (gap, _), (far, worst) = sorted((100 * row["gap_max"], row["method"]) for row in rows)
    numbers = {"count": count, "bodies": bodies, "gap": gap, "far": far, "worst": worst}
    return f"{short_table(rows)}\n\n{words(form, after=after, off=off, **numbers)}"


def when_to_train(result: Callable[[str], Result]) -> str:
    """Return what training is for, and for each kind of scene when it pays."""
    sections = lift_designs.when_to_train(result("lift_designs"))
    large = fit_memory.in_short(result("fit_memory"), result("three_loads_lift"))
    drags = f"{_plane(result)} {_space(result)}"
    several = section_designs.in_short(result("section_designs"))
    lines = _purpose(result), drags, f"{sections} {large}", f"{_robust(result)} {several}"
    return "\n".join(f"- {line}" for line in lines)


def _purpose(result):
    """Return what to train for, and whether trainings cost less than kriging with memory by G."""
    after = {"sections": lift_designs.over_kriging(result("lift_designs"))}
    for scene, study in (("drag in 2-D", "payoff"), ("drag in 3-D", "payoff_space")):
        found = result(study)
        if len(found["queries"]) > LATE:  # else too few to say
            rows = _over_kriging(found["payoff"])
            after[scene] = min((row["beats_kriging_g"] for row in rows), default=math.inf)
    paid = [f"{name} (design {n:.0f})" for name, n in after.items() if n <= MOST_DESIGNS]
    form = (
        "Train for answers by the million or outside JAX. For designs alone kriging with memory "
        "(`Designer(Flow(scene))`) took fewer G than every training, extrapolated to "
        "{most:,} designs{but}."
    )
    return words(form, most=MOST_DESIGNS, but=f", but for {', '.join(paid)}" if paid else "")


def _plane(result):
    rows = result("payoff")["payoff"]
    kriging = next(row for row in rows if row["method"] == "kriging with memory")
    *_, (early, fifty), (late, thousand) = zip(SHOWN_DESIGNS, kriging["cumulative_g"], strict=True)
    form = "Drag in 2-D: kriging ends at {late:.0f} G a design{by_clock}."
    return words(form, late=(thousand - fifty) / (late - early), by_clock=_by_clock(rows))


def _by_clock(rows):
    """Return the training that pays first against kriging with memory by wall clock, in words."""
    paying = _over_kriging(rows, "s")
    if not paying:
        return ""
    first = min(paying, key=lambda row: row["beats_kriging_s"])
    return (
        f"; by wall clock `{first['method']}` beats kriging from design {first['beats_kriging_s']}"
    )


def _over_kriging(rows, unit="g"):
    """Return the rows of the trainings that pay against kriging with memory, by G or seconds."""
    return [row for row in rows if row["training_g"] and row[f"beats_kriging_{unit}"] is not None]


def _space(result):
    rows = result("payoff_space")["payoff"]
    paid = [row for row in rows if row["training_g"] and row["break_even_g"] is not None]
    first = min(paid, key=lambda row: row["break_even_g"])
    settings, queries = result("payoff_space")["settings"], len(result("payoff_space")["queries"])
    seeds = "one seed" if settings["seeds"] == 1 else f"{settings['seeds']} seeds"
    form = (
        "In 3-D, {queries} queries, {seeds}: by G `{method}` pays against `direct` after "
        "{break_even_g:.1f} designs."
    )
    return words(form, queries=queries, seeds=seeds, **first)


def _robust(result):
    rows = result("scenarios")["rows"]
    cases = max(row["cases"] for row in rows)
    flows = {row["strategy"]: row["flows"] for row in rows if row["cases"] == cases}
    form = (
        "{designs} robust designs over {cases} cases: {network, and kriging:.0f} flows each led by "
        "the network, {kriging from nothing:.0f} by kriging without memory, {direct:.0f} by "
        "`direct`."
    )
    designs = len(rows[0]["objectives"])
    return words(form, designs=designs, cases=cases, **flows)


def accuracy(result: Callable[[str], Result]) -> str:
    """Return the errors of the flow, of the shipped surrogates and of the best correlation."""
    lines = _flow(result), _shipped(), particle.in_short(result("particle"))
    return "\n".join(f"- {line}" for line in lines)


def _flow(result):
    def standard(study, panel):
        rows = [row for row in result(study)["rows"] if row["panel"].startswith(panel)]
        chosen = [row for row in rows if "standard" in (row["row"].split(",")[0], row["column"])]
        return [row["error"] for row in chosen]

    random = result("random_sections")
    drawn = random_sections.with_onset([*random["rows"], *random["wide"]])
    sections = [row for row in random_sections.steady(drawn) if row["fidelity"] == "standard"]
    form = (
        "The flow, standard grid, against body-fitted finite elements, mean and largest error in "
        "%: Cd of the cylinder {cylinder}, of {symmetric} random symmetric "
        "bodies {random}, of {count} random steady sections at incidence {cd}, their Cl {cl}, "
        "Cm {cm} of Cd; in 3-D Cd of the sphere {sphere}, of {revolved} bodies of revolution "
        "{aspect}, of ellipsoids in Stokes flow {ellipsoids}."
    )
    panels = "sphere", "ellipsoids", "aspect"
    off = {panel: mean_and_most(standard("flow_3d", panel)) for panel in panels}
    off |= {load: mean_and_most(row[f"{load}_error"] for row in sections) for load in LOADS}
    off["cylinder"] = mean_and_most(standard("flow", "accuracy"))
    bodies, *off["random"] = far_field.symmetric_errors(result("far_field"))
    revolved = len(standard("flow_3d", "aspect"))
    numbers = {"count": len(sections), "revolved": revolved, "symmetric": bodies}
    pairs = {name: f"{100 * mean:.2f}, {100 * most:.2f}" for name, (mean, most) in off.items()}
    return f"{words(form, **numbers, **pairs)} {onset_2d.in_short(result('onset_2d'))}"


def _shipped():
    """Return mean and largest errors of the shipped surrogates on their held-out bodies."""

    def errors(name):
        record = load(name).record
        loads = [load for load in ("drag", "lift", "moment") if f"{load}_error_mean" in record]
        mean = "/".join(f"{100 * record[f'{load}_error_mean']:.2f}" for load in loads)
        most = max(record[f"{load}_error_max"] for load in loads)
        return f"`{name}` {mean}, {100 * most:.1f}"

    each = "; ".join(map(errors, SHIPPED))
    return (
        "The surrogates against the flow, mean (Cd/Cl/Cm) and largest error on their "
        f"held-out bodies, in % of Cd: {each}."
    )


PASSAGES = {
    "duration": duration,
    "payoff": payoff,
    "when_to_train": when_to_train,
    "accuracy": accuracy,
}
