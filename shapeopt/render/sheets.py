"""What goes on a sheet of pictures: a run's cylinder or sphere and its optimum, both solved."""

from pathlib import Path
from typing import Any

from shapeopt.render.bodies_3d import render_bodies
from shapeopt.render.pictures import Panel, render_flows
from shapeopt.runs import run_body, run_scene
from surrogate.flow.flow import Flow
from surrogate.flow.solution import Solution


def solve_run(record: dict[str, Any]) -> tuple[Solution, Solution]:
    """The cylinder and the run's optimum, solved on the run's own grid.

    Raises:
      NotConverged: one of the flows was not found.
    """
    scene = run_scene(record)
    bodies = scene.family.ellipse(1.0), run_body(record)
    start, optimum = (
        Flow(scene).solve(body, record["reynolds"], estimate=False, allow_unsteady=True)
        for body in bodies
    )
    return start, optimum


def before_and_after(record: dict[str, Any]) -> list[Panel]:
    """Two panels: the cylinder, and the run's optimum.

    Raises:
      NotConverged: as ``solve_run``.
    """
    start, optimum = solve_run(record)
    reynolds, gain = f"Re {record['reynolds']:g}", 100 * (optimum.drag / start.drag - 1)
    before = f"{reynolds}    {run_scene(record).family.round_body}    Cd {start.drag:.4f}"
    after = f"{reynolds}    optimum    Cd {optimum.drag:.4f}    {gain:+.1f} %"
    return [
        Panel(start, before, "drag by the flow solver"),
        Panel(optimum, after, f"{origin(record)}, {standing(record)}"),
    ]


def render_panels(rows: list[list[Panel]], path: str | Path) -> Path:
    """A sheet of solved flows, of the plane or of space; whole or not at all."""
    dimension = rows[0][0].solution.shape.dimension
    return (render_bodies if dimension == 3 else render_flows)(rows, path)


def origin(record: dict[str, Any]) -> str:
    """Which way an optimum was found, for a caption."""
    if record["surrogate"] == "none":
        return "found by the flow's adjoint"
    return f"found by the surrogate {Path(record['surrogate']).name}"


def standing(record: dict[str, Any]) -> str:
    """Whether the flow has confirmed an optimum, for a caption."""
    return "not verified" if record.get("cd_verified") is None else "verified by the flow"
