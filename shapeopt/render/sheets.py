"""Pictures of a run: its reference body and its optimum, both solved."""

from pathlib import Path

from shapeopt.records import is_by_chord, reynolds_text, run_body, run_scene, surrogate_name
from shapeopt.render.bodies_3d import PRESSURE, Load, render_bodies, solved_panel
from shapeopt.render.pictures import Panel, render_flows
from surrogate.files import JsonObject
from surrogate.flow.flow import Flow
from surrogate.flow.solution import Solution

GAP = "    "  # between the parts of a title


def solve_run(record: JsonObject) -> tuple[Solution, Solution]:
    """Solve the flows of the reference body and of the run's optimum on the run's grid.

    Raises:
      NotConverged: a flow did not converge.
    """
    scene = run_scene(record)
    flow = Flow(scene)
    bodies = scene.family.ellipse(_reference_aspect(record)), run_body(record)
    reference, optimum = (
        flow.solve(body, record["reynolds"], estimate=False, allow_unsteady=True) for body in bodies
    )
    return reference, optimum


def reference_name(record: JsonObject) -> str:
    """Return the name of a run's reference body.

    It is the cylinder (in 3-D the sphere), with whose drag the optimum's is compared. Where it is
    not, as the run was by the chord or about lift, or the cylinder's flow does not converge, it is
    the ellipse (spheroid) of the optimum's aspect along the stream.
    """
    scene = run_scene(record)
    if is_compared(record):
        return scene.family.round_body
    ellipse = "ellipse" if scene.dimension == 2 else "spheroid"
    return f"{ellipse} of aspect {_reference_aspect(record):.3g}"


def _reference_aspect(record):
    return 1.0 if is_compared(record) else record["parameters"]["aspect"]


def before_and_after(record: JsonObject) -> list[Panel]:
    """Return panels of the reference body and of the run's optimum, whose flows are solved.

    Raises:
      NotConverged: a flow did not converge.
    """
    reference, optimum = solve_run(record)
    reynolds, lifting = reynolds_text(record), run_scene(record).family.has_lift
    if cases := several_cases(record):
        lifts = record["objective"].get("lifts")
        reynolds += f", first of {cases} lifts" if lifts else f", nominal of {cases} cases"
    before = [reynolds, reference_name(record), *_coefficients(record, reference)]
    after = [reynolds, "optimum", *_coefficients(record, optimum)]
    if is_compared(record) and not cases:
        after.append(f"{100 * (optimum.drag / reference.drag - 1):+.1f} %")
    if cases and "glide" in record:
        after.append(f"Cl/Cd of the cases {record['glide']:.3f}")
    before, after = (GAP.join(words) for words in (before, after))
    return [
        Panel(reference, before, f"{'loads' if lifting else 'drag'} by the flow solver"),
        Panel(optimum, after, f"{origin(record)}, {standing(record)}"),
    ]


def several_cases(record: JsonObject) -> int:
    """Return the number of cases over which a run's objective is taken; 0 where it is one."""
    cases = record["objective"]["number_of_cases"]
    return cases if cases > 1 else 0


def is_compared(record: JsonObject) -> bool:
    """Return whether a run's drag is compared with that of the cylinder (sphere)."""
    unsolved = record["cd_verified"] is not None and record["cd_start"] is None
    return not (unsolved or record["about_lift"] or is_by_chord(record))


def _coefficients(record: JsonObject, solution: Solution) -> list[str]:
    """Return Cd, and of bodies with lift Cl and, in 2-D, the glide ratio, as words for a title."""
    unit = solution.chord if is_by_chord(record) else 1.0
    cl = round(solution.lift / unit, 4) + 0.0  # no minus zero
    words, lifting = [f"Cd {solution.drag / unit:.4f}"], run_scene(record).family.has_lift
    if lifting:
        words.append(f"Cl {cl:.4f}")
    if lifting and solution.shape.dimension == 2:
        words.append(f"Cl/Cd {cl * unit / solution.drag:.3f}")
    return words + ["over c"] * is_by_chord(record)


def render_panels(rows: list[list[Panel]], path: str | Path, load: Load = PRESSURE) -> Path:
    """Draw flows, 2-D or 3-D, as a PNG and return its path; 3-D bodies are coloured by ``load``."""
    if rows[0][0].solution.shape.dimension == 3:
        return render_bodies([[solved_panel(one) for one in row] for row in rows], path, load)
    return render_flows(rows, path)


def origin(record: JsonObject) -> str:
    """Return by which model an optimum was found, for a caption."""
    named = surrogate_name(record)
    name = f"the surrogate {Path(named).name}" if named else "a surrogate"
    if record["until"] == "surrogate":
        return f"found by {name}"
    return f"found by the flow's adjoint{f', led by {name}' if named else ''}"


def standing(record: JsonObject) -> str:
    """Return whether an optimum is verified by the flow, as words for a caption."""
    return "not verified" if record["cd_verified"] is None else "verified by the flow"
