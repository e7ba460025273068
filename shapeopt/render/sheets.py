"""Pictures of a run: its reference body (cylinder or sphere) and its optimum, both solved."""

from pathlib import Path

from shapeopt.render.bodies_3d import PRESSURE, Load, render_bodies
from shapeopt.render.pictures import Panel, render_flows
from shapeopt.runs import run_body, run_scene
from surrogate.files import JsonObject
from surrogate.flow.flow import Flow
from surrogate.flow.solution import Solution


def solve_run(record: JsonObject) -> tuple[Solution, Solution]:
    """Solve the flows of the reference body and of the run's optimum on the run's grid.

    Raises:
      NotConverged: a flow did not converge.
    """
    scene = run_scene(record)
    bodies = scene.family.ellipse(1.0), run_body(record)
    start, optimum = (
        Flow(scene).solve(body, record["reynolds"], estimate=False, allow_unsteady=True)
        for body in bodies
    )
    return start, optimum


def before_and_after(record: JsonObject) -> list[Panel]:
    """Panels of the reference body and of the run's optimum.

    Raises:
      NotConverged: a flow did not converge.
    """
    start, optimum = solve_run(record)
    reynolds, gain = f"Re {record['reynolds']:g}", 100 * (optimum.drag / start.drag - 1)
    before = f"{reynolds}    {run_scene(record).family.round_body}    Cd {start.drag:.4f}"
    after = f"{reynolds}    optimum    Cd {optimum.drag:.4f}    {gain:+.1f} %"
    return [
        Panel(start, before, "drag by the flow solver"),
        Panel(optimum, after, f"{origin(record)}, {standing(record)}"),
    ]


def render_panels(rows: list[list[Panel]], path: str | Path, load: Load = PRESSURE) -> Path:
    """Draw flows, 2-D or 3-D, as a PNG and return its path; 3-D bodies are coloured by ``load``."""
    if rows[0][0].solution.shape.dimension == 3:
        return render_bodies(rows, path, load)
    return render_flows(rows, path)


def origin(record: JsonObject) -> str:
    """The model by which an optimum was found, for a caption."""
    if record["surrogate"] == "none":
        return "found by the flow's adjoint"
    return f"found by the surrogate {Path(record['surrogate']).name}"


def standing(record: JsonObject) -> str:
    """Whether an optimum is verified by the flow, for a caption."""
    return "not verified" if record.get("cd_verified") is None else "verified by the flow"
