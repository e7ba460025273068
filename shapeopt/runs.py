"""Runs: how the folder of files that a shape optimisation leaves is written."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from shapeopt.problem.objective import scenarios_of
from shapeopt.problem.scenarios import model_loads, model_objective
from shapeopt.records import DRAGS, NO_SURROGATE, RECORD, UNNAMED
from shapeopt.search.design import Design
from shapeopt.search.optimality import KKT_TOLERANCE
from shapeopt.search.verify import (
    NOTICED,
    Verified,
    loads_by_reference,
    loads_of,
    violated_bounds,
)
from surrogate.body.chord_line import CHORD, DIAMETER
from surrogate.body.drawing import drawn_contour
from surrogate.body.shape import family_shape
from surrogate.checks import expect
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import (
    JsonObject,
    check_target,
    file_digests,
    whole_files,
)
from surrogate.flow.flow import Flow
from surrogate.flow.solution import Solution
from surrogate.flow.surface.surface import SURFACE_POINTS
from surrogate.model.surrogate import Surrogate
from surrogate.repeats import differences
from surrogate.versions import command_line


def save_run(
    folder: str | Path,
    design: Design,
    surrogate: Surrogate | None = None,
    name: str | None = None,
    verify: bool = True,
    settings: JsonObject | None = None,
) -> dict[str, Any]:
    """Write a design into a folder: run.json, contour.csv, contour.vtp and body.stl.

    contour.vtp carries the flow's surface loads if it is verified. In 3-D contour.csv is the
    outline seen from the side, and contour.vtp the surface. contour.csv, and in 2-D body.stl, show
    the body at zero incidence, the others as it lies in the stream.

    Args:
      folder: new, empty, or of an earlier run; other files in it stay.
      design: what was found.
      surrogate: by which it was found, if by one.
      name: name of the surrogate, by which ``surrogate.load`` finds it; "none" by default without
        a surrogate, "unnamed" with one.
      verify: whether to solve the flow, once for each scenario of the objective and, where there
        are several, for the body itself.
      settings: what defines the design, by which ``stored_run`` knows it again.

    Returns:
      The record, as in run.json. Coefficients and constraints are by the length that "reference"
      names, "diameter" or "chord"; "chord", "thickness" and "camber" are in D, "reynolds" is U D /
      nu and "chord_reynolds" U c / nu. "constraints" are those the problem sets, "about_lift" is as
      ``Problem.is_about_lift``. cd_* are values of the problem's objective: Cd where that is the
      drag at one Reynolds number; of the glide ratio and of a settling speed Cd itself at the
      nominal Reynolds number, and "glide" is the optimal ratio, of several scenarios their mean or
      that of the worst. cd_start is that of the cylinder
      (sphere) in the same scenarios, None where it is not known; it is not where the search began.
      cl_verified and cm_verified, and such a cd_verified, are those of the body itself at the
      nominal Reynolds number, None where that flow does not converge; of several lifts, those at
      the first one. "violated" names the bounds
      on loads that the flow does not meet, with its loads; "multipliers" are the derivatives of the
      optimal objective, of the glide ratio -Cl / Cd, in each active bound.

    Raises:
      InvalidInput: the folder cannot be written to, or ``design`` is no design.
      NotConverged: a flow of the verification did not converge.
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
    if name is None:
        name = NO_SURROGATE if surrogate is None else UNNAMED
    expect("save_run: name", name, str, "text")
    if surrogate is not None and surrogate.scene != design.problem.scene:
        found = differences(design.problem.scene.record, surrogate.scene.record)
        raise InvalidInput(f"save_run: design and surrogate are of different scenes: {found}")
    check_run_folder(folder)
    folder, scene = Path(folder), design.problem.scene
    verified = design.verified if verify else None
    solution = verified and _nominal_flow(design, verified)
    record = {
        **_search_record(design),
        **_verification_record(design, verified, solution, surrogate),
        "contour": str(folder / "contour.csv"),
        "surrogate": name,
        "until": "flow" if design.on_flow else "surrogate",
        "scene": scene.record,
        "path": design.path.tolist(),
        "command": command_line(),
        "settings": settings,
    }
    contour = np.asarray(scene.family.outline(design.parameters, SURFACE_POINTS))
    with whole_files(folder, RECORD) as part:
        write_contour_csv(contour, part / "contour.csv")
        vtp, stl = part / "contour.vtp", part / "body.stl"
        if scene.dimension == 3:
            named = scene.family.named(design.parameters)
            write_skin(family_shape(named, dimension=3), vtp, stl, solution)
        else:
            turned = np.asarray(
                drawn_contour(scene.family.body_class, design.parameters, SURFACE_POINTS)
            )
            write_contour_vtp(turned, vtp, solution and solution.surface())
            write_solid_stl(contour, stl)
        record["files_sha256"] = file_digests(part)
        (part / RECORD).write_text(json.dumps(record, indent=1) + "\n")
    return record


def check_run_folder(folder: str | Path) -> None:
    """Raise InvalidInput unless a run may be written to the folder."""
    check_target(folder, RECORD, ("parameters", "scene"))


def _search_record(design: Design) -> dict[str, Any]:
    """Return the objective, the constraints that are set, and the result of the search."""
    problem, body = design.problem, design.problem.scene.family.body_class
    camber = {}
    if body.camber_modes:
        camber["camber"] = float(body.camber(design.parameters))
    return {
        "parameters": problem.scene.family.named(design.parameters),
        "chord": design.chord,
        "thickness": design.thickness,
        **camber,
        "reynolds": design.reynolds,
        "chord_reynolds": design.chord_reynolds,
        "reference": CHORD if problem.by_chord else DIAMETER,
        "objective": {
            "kind": type(problem.objective).__name__,
            "number_of_cases": len(problem.scenarios.weight),
            **problem.objective.record(problem.scene),
        },
        "about_lift": problem.is_about_lift,
        "constraints": json.loads(json.dumps(problem.constraints)),  # tuples become lists
        "flows": design.flows,
        "green_applications": design.green_applications,
        "kkt_residual": design.kkt_residual,
        "calls": design.calls,
        "loop_s": design.seconds,
        "converged": design.converged,
        "at_range_ends": problem.at_range_ends(design.variables),
        "multipliers": design.multipliers,
    }


def _verification_record(
    design: Design,
    verified: Verified | None,
    solution: Solution | None,
    surrogate: Surrogate | None,
) -> dict[str, Any]:
    """Return the objective by surrogate and flow, and the loads of every scenario.

    Args:
      design: what was found.
      verified: its flows, if they were solved.
      solution: the flow past the body itself, if it is known.
      surrogate: by which the design was found, if by one.
    """
    problem, scenarios = design.problem, design.problem.scenarios
    network = surrogate and problem.reference.model(surrogate.network)
    record: dict[str, Any] = {**dict.fromkeys(DRAGS), "verify_s": 0.0, "cases": []}
    slack = KKT_TOLERANCE if design.on_flow else NOTICED
    drags = [None] * len(scenarios.weight)
    if network is not None:
        drags = model_loads(network, design.variables, scenarios)[0][:, 0].tolist()
    if verified is not None:
        loads = loads_of(problem, design.variables, verified.solutions)
        nominal = [None] * 3
        if solution is not None:
            nominal = loads_by_reference(problem, design.parameters, solution)
        rows = zip(
            *(scenarios.bodies(design.variables), scenarios.weight, verified.round_drags, drags),
            *(loads.tolist(), verified.solutions),
            strict=True,
        )
        cases = [
            {
                "parameters": body.tolist(),
                "reynolds": case.reynolds,
                "weight": float(weight),
                "cd_start": round_drag,
                "cd_surrogate": drag,
                "cd_verified": cd,
                "cl_verified": cl,
                "cm_verified": cm,
                "onset": case.onset,
                "status": case.status,
                "expected_error": case.expected_error,
                "estimated_error": case.estimated_error,
            }
            for body, weight, round_drag, drag, (cd, cl, cm), case in rows
        ]
        record |= {
            "cd_start": verified.round_objective,
            "cd_verified": verified.objective,
            "cl_verified": nominal[1],
            "cm_verified": nominal[2],
            "status": verified.status,
            "accuracy": verified.accuracy,
            "cells": verified.solutions[0].fidelity.cells,
            "violated": violated_bounds(problem, loads, slack),
            "expected_error": verified.expected_error,
            "estimated_error": verified.estimated_error,
            "verify_s": verified.seconds,
            "cases": cases,
        }
    one_drag = bool(scenarios.glide | scenarios.force)  # the objective is not, or no mean of, Cd
    if network is not None:
        wanted = scenarios
        if one_drag:  # that of the body itself
            wanted = scenarios_of(problem.scene, [problem.objective.nominal], [1.0])
        record["cd_surrogate"] = float(model_objective(network, design.variables, wanted))
    if one_drag and verified is not None:
        record["cd_verified"] = nominal[0]
    if bool(scenarios.glide) and verified is not None:
        record["glide"] = -verified.objective
    return record


def _nominal_flow(design: Design, verified: Verified) -> Solution | None:
    """Return the body's flow at the nominal Re; None where it does not converge.

    It is the first of the cases where these differ in the incidence alone.
    """
    problem = design.problem
    if len(verified.solutions) == 1 or problem.objective.lifts:
        return verified.solutions[0]
    try:
        return Flow(problem.scene).solve(
            design.parameters, problem.objective.nominal, estimate=False, allow_unsteady=True
        )
    except NotConverged:
        return None
