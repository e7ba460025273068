"""A run: the folder of a shape optimisation, its record read and written here alone."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from shapeopt.problem.objective import Robust, predicted, predicted_drags
from shapeopt.problem.problem import Problem
from shapeopt.search.design import Design
from surrogate.body.shape import family_shape
from surrogate.checks import expect, finite_number
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import check_target, path_of, strict_json, whole_files
from surrogate.flow.flow import Flow
from surrogate.flow.surface.surface import SURFACE_POINTS
from surrogate.model.surrogate import Surrogate
from surrogate.scene.limits import check_reynolds
from surrogate.scene.scene import Scene
from surrogate.training.record import command_line

RECORD = "run.json"
LONGEST_RECORD = 1 << 24  # bytes
DRAGS = ("cd_start", "cd_surrogate", "cd_verified")


def save_run(
    folder: str | Path,
    design: Design,
    surrogate: Surrogate | None = None,
    name: str = "none",
    verify: bool = True,
) -> dict[str, Any]:
    """Write run.json, contour.csv, contour.vtp with the flow's loads, and body.stl.

    In space contour.csv is the outline seen from the side, contour.vtp the skin.

    Args:
      folder: new, empty, or an older run's; other files in it stay.
      design: what was asked and found.
      surrogate: by which it was found, if it was one.
      name: of the surrogate, by which ``load`` finds it again.
      verify: ask the flow, which takes as many flows as the objective has cases.

    Returns:
      The record. cd_* are values of the problem's objective, a Cd for one Reynolds number.

    Raises:
      InvalidInput: the folder is not to be written to, or it is no design.
      NotConverged: a flow of the verification was not found.
    """
    # pyvista takes a second to import, which only files and pictures need
    from shapeopt.export.files import (
        write_contour_csv,
        write_contour_vtp,
        write_skin,
        write_solid_stl,
    )

    expect("save_run", design, Design, "Design")
    expect("save_run", surrogate, Surrogate | None, "Surrogate")
    expect("save_run: name", name, str, "text")
    if surrogate is not None and surrogate.scene != design.problem.scene:
        raise InvalidInput("save_run: design and surrogate are of different scenes")
    check_run_folder(folder)
    folder, problem = Path(folder), design.problem
    verified = design.verified if verify else None
    record = {
        **_found(design),
        **_said_by_the_flow(design, verified, surrogate),
        "contour": str(folder / "contour.csv"),
        "surrogate": name,
        "scene": problem.scene.record,
        "path": design.path.tolist(),
        "command": command_line(),
    }
    record["cd_surrogate"] = _predicted(design, surrogate)
    contour = np.asarray(problem.scene.family.outline(design.parameters, SURFACE_POINTS))
    solution = verified.solutions[0] if verified and _single(problem) else None
    solution = solution or _solved(design)
    with whole_files(folder, RECORD) as part:
        write_contour_csv(contour, part / "contour.csv")
        vtp, stl = part / "contour.vtp", part / "body.stl"
        if problem.scene.dimension == 3:
            named = problem.scene.family.named(design.parameters)
            write_skin(family_shape(named, dimension=3), vtp, stl, solution)
        else:
            write_contour_vtp(contour, vtp, solution and solution.surface())
            write_solid_stl(contour, stl)
        (part / RECORD).write_text(json.dumps(record, indent=1) + "\n")
    return record


def check_run_folder(folder: str | Path) -> None:
    """Raise InvalidInput unless a run may be written there."""
    check_target(folder, RECORD, ("parameters", "scene"))


def load_run(folder: str | Path) -> dict[str, Any]:
    """The record of a run.

    Raises:
      InvalidInput: the folder is missing, or holds no readable run.
    """
    folder = path_of(folder)
    try:
        if (folder / RECORD).stat().st_size > LONGEST_RECORD:
            raise ValueError
        record = strict_json((folder / RECORD).read_text(encoding="utf-8"))
        scene = Scene.of(record["scene"])
        scene.family.check(scene.family.parameters(record["parameters"]))
        scene.family.check_all(np.array(record["path"]))
        check_reynolds(record["reynolds"], True, scene.dimension)
        drags = [record[name] for name in DRAGS if record.get(name) is not None]
        cases, name = record.get("cases", []), record["surrogate"]
        sound = all(finite_number("drag", drag) > 0 for drag in drags) and record["path"]
        if not (sound and isinstance(cases, list) and isinstance(name, str)):
            raise ValueError
        return record
    except OSError:
        raise InvalidInput(f"run {folder}: no {RECORD} there; a run has one") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InvalidInput(f"run {folder}: {RECORD} is damaged or of another program") from None


def run_scene(record: dict[str, Any]) -> Scene:
    """The scene of a run."""
    return Scene.of(record["scene"])


def run_body(record: dict[str, Any]) -> np.ndarray:
    """The parameters that a run found."""
    return run_scene(record).family.parameters(record["parameters"])


def _single(problem):
    return len(problem.scenarios.weight) == 1


def _found(design: Design) -> dict[str, Any]:
    """What was asked, and what came of the search."""
    problem = design.problem
    low, high = problem.scene.family.bounds.T
    edges = np.minimum(design.parameters - low, high - design.parameters) / (high - low)
    return {
        "parameters": problem.scene.family.named(design.parameters),
        "reynolds": problem.objective.nominal,
        "objective": _objective(problem),
        "flows": design.flows,
        "green_applications": design.green_applications,
        "kkt_residual": design.kkt_residual,
        "calls": design.calls,
        "loop_s": design.seconds,
        "converged": True,
        "edge_distance": float(edges.min()),
    }


def _objective(problem: Problem) -> dict[str, Any]:
    objective = problem.objective
    plain = {"kind": type(objective).__name__, "number_of_cases": len(problem.scenarios.weight)}
    if isinstance(objective, Robust):
        plain |= {
            "spread": objective.spread.spread,
            "distribution": type(objective.spread).__name__,
            "tolerance": objective.tolerance,
            "cvar": objective.level,
            "seed": objective.seed,
            "kept": objective.kept(problem.scene),
        }
    return plain


def _predicted(design, surrogate):
    """The objective by the surrogate, at the body that was found in the end."""
    if surrogate is None:
        return None
    return float(predicted(surrogate.network, design.parameters, design.problem.scenarios))


def _said_by_the_flow(design, verified, surrogate) -> dict[str, Any]:
    """Objective, status and estimated error, and every case's drags."""
    if verified is None:
        return {"cd_start": None, "cd_verified": None, "verify_s": 0.0, "cases": []}
    scenarios, guesses = design.problem.scenarios, [None] * len(verified.solutions)
    if surrogate is not None:
        drags, _ = predicted_drags(surrogate.network, design.parameters, scenarios)
        guesses = np.asarray(drags).tolist()
    cases = [
        {
            "parameters": (design.parameters + shift).tolist(),
            "reynolds": solution.reynolds,
            "weight": float(weight),
            "cd_start": float(cylinder),
            "cd_surrogate": guess,
            "cd_verified": solution.drag,
            "status": solution.status,
            "estimated_error": solution.estimated_error,
        }
        for shift, weight, cylinder, guess, solution in zip(
            scenarios.shift,
            scenarios.weight,
            verified.cylinder,
            guesses,
            verified.solutions,
            strict=True,
        )
    ]
    return {
        "cd_start": verified.cylinder_objective,
        "cd_verified": verified.objective,
        "status": verified.status,
        "estimated_error": verified.estimated_error,
        "verify_s": verified.seconds,
        "cases": cases,
    }


def _solved(design: Design):
    """The body's flow at the nominal Re; None where it is not to be had."""
    problem = design.problem
    try:
        at = design.parameters, problem.objective.nominal
        return Flow(problem.scene).solve(*at, estimate=False, allow_unsteady=True)
    except NotConverged:
        return None
