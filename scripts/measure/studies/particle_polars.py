"""Polars of two spheroids by the shipped surrogate of particles, the flow and correlations."""

import dataclasses
import functools
from pathlib import Path

import numpy as np
from correlations_at_incidence import AT_INCIDENCE, Inclined, Loads
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from study import Result, Row, Run, cases, columns, values
from tools import LOADS

from shapeopt.render.figures import STYLE, save_figure
from shapeopt.render.polar import LABELS
from surrogate import Flow, load
from surrogate.flow.output.palette import INK

SURROGATE = "pretrained:particle"
POLARS = cases(aspect=(2.5, 0.5), incidence=range(0, 91, 15))  # a prolate and an oblate spheroid
POLAR_REYNOLDS = 20.0
# of the surrogate and the correlations in the picture
LINES = ("-", "--", "-.", ":", (0, (6, 2, 1, 2, 1, 2)))


@functools.cache
def flow_of(tiny: bool) -> Flow:
    """Return the flow that the surrogate was trained on, in tiny runs on few cells."""
    scene = load(SURROGATE).scene
    coarse = dataclasses.replace(scene.fidelity, cells=5)
    return Flow(dataclasses.replace(scene, fidelity=coarse) if tiny else scene)


def polar(run: Run, aspect: float, incidence: float) -> Row:
    """Return the loads of a spheroid at Re 20 by the flow and the surrogate."""
    net = load(SURROGATE)
    body = net.scene.family.parameters({"aspect": aspect, "incidence": incidence})
    answers = {
        name: Loads(*np.asarray(model.loads(body, POLAR_REYNOLDS)).tolist())
        for name, model in (("flow", flow_of(run.tiny)), ("surrogate", net))
    }
    return {"loads": {name: answer._asdict() for name, answer in answers.items()}}


def polars_with_correlations(rows: list[Row]) -> list[Row]:
    """Return rows of ``polar`` with the loads by every correlation as well."""

    def loads(row):
        body = Inclined(row["aspect"], incidence=row["incidence"])
        found = {n: answer(body, POLAR_REYNOLDS) for n, answer in AT_INCIDENCE.items()}
        return {name: (answer or Loads(None))._asdict() for name, answer in found.items()}

    return [row | {"loads": row["loads"] | loads(row)} for row in rows]


def show_polars(rows: list[Row]) -> str:
    """Return one table for each load, with those who answer it in its columns."""
    parts, rows = [], polars_with_correlations(rows)
    for load_name, symbol in zip(LOADS, ("Cd", "Cl", "Cm"), strict=True):
        form = "aspect {aspect:g} | incidence {incidence:g}"
        for name in rows[0]["loads"]:
            if any(row["loads"][name][load_name] is not None for row in rows):
                form += f" | {symbol}, {name} {{loads[{name}][{load_name}]:z.4f}}"
        parts.append(columns(form)(rows))
    return "\n\n".join(parts)


def draw(result: Result, path: Path) -> None:
    """Draw Cd, Cl and Cm of each spheroid over the incidence: the flow as points, others lines."""
    rows = polars_with_correlations(result["polar"])
    with rc_context(STYLE):
        aspects = values(rows, "aspect")
        size = {"figsize": (13, 3.4 * len(aspects)), "layout": "constrained"}
        figure = Figure(**size)
        axes = figure.subplots(len(aspects), len(LOADS), squeeze=False)
        for line, aspect in zip(axes, aspects, strict=True):
            mine = [row for row in rows if row["aspect"] == aspect]
            for axis, load_name in zip(line, LOADS, strict=True):
                _draw_polar(axis, mine, load_name)
            line[0].set_title(f"spheroid of aspect {aspect:g}, Re {POLAR_REYNOLDS:g}")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside right upper")
        save_figure(figure, path)


def _draw_polar(axis: Axes, rows: list[Row], load_name: str) -> None:
    turns = [row["incidence"] for row in rows]
    answers = {n: [row["loads"][n][load_name] for row in rows] for n in rows[0]["loads"]}
    axis.plot(turns, answers.pop("flow"), "o", color=INK, ms=5, zorder=3, label="flow")
    for k, (name, answer) in enumerate(answers.items()):
        if None not in answer:
            axis.plot(turns, answer, linestyle=LINES[k % len(LINES)], color=f"C{k}", label=name)
    axis.set(xlabel=LABELS["incidence"], ylabel=LABELS[load_name], xticks=range(0, 91, 15))
    if load_name != "cd":
        axis.axhline(0, color=INK, lw=0.6)
