"""Predictions compared with the flow, for predict_drag.py --verify."""

from collections.abc import Sequence

from shapeopt.commands.reference import CHORD
from surrogate.arrays import AnyArray
from surrogate.body.chord_line import loads_by_chord
from surrogate.body.shape import family_shape
from surrogate.errors import NotConverged
from surrogate.files import JsonObject
from surrogate.flow.flow import Flow
from surrogate.model.surrogate import Surrogate
from surrogate.progress import progress_bar

VERIFIED = (  # what --verify adds to a row
    *("cd_flow", "cl_flow", "cm_flow", "cd_error", "cl_error", "cm_error"),
    *("status", "accuracy", "expected_error", "estimated_error"),
)


def compared_with_flow(
    surrogate: Surrogate, bodies: Sequence[AnyArray], rows: Sequence[JsonObject]
) -> list[JsonObject]:
    """Return the rows with the flow's loads and the errors; None where it does not converge.

    Args:
      surrogate: that predicted the loads of the rows.
      bodies: parameters of the body of every row.
      rows: predictions, with "reynolds", "cd", "cl", "cm", "reference", "chord".
    """
    verified = []
    with progress_bar("verification") as progress:
        for k, (body, row) in enumerate(zip(bodies, rows, strict=True)):
            try:
                found = _by_flow(surrogate, body, row)
            except NotConverged:
                about = ("cm_about_flow",) if "moment_about" in row else ()
                found = dict.fromkeys((*VERIFIED, *about)) | {"status": "not converged"}
            verified.append(row | {"converged": found["cd_flow"] is not None} | found)
            state = f"Re {row['reynolds']:.4g}: {verified[-1]['status']}"
            progress((k + 1) / len(rows), f"flow {k + 1} of {len(rows)}, {state}")
    return verified


def _by_flow(surrogate: Surrogate, parameters: AnyArray, row: JsonObject) -> JsonObject:
    """Solve the flow: on the scene's grid inside the trained ranges, else on one for the body."""
    scene, body = surrogate.scene, parameters
    if not row["in_trained_range"]:
        body = family_shape(scene.family.named(parameters), dimension=scene.dimension)
    solution = Flow(scene).solve(body, row["reynolds"], allow_unsteady=True)
    by = row["chord"] if row["reference"] == CHORD else 1.0
    drag, lift, moment = loads_by_chord(solution.loads, by).tolist()
    flow = {"cl": lift, "cm": moment}
    errors = {f"{load}_error": abs(row[load] - value) for load, value in flow.items()}
    about = {}
    if "moment_about" in row:
        about["cm_about_flow"] = solution.moment_about(row["moment_about"]) / by**2
    return {
        "cd_flow": drag,
        "cl_flow": flow["cl"],
        "cm_flow": flow["cm"],
        "cd_error": abs(row["cd"] / drag - 1),
        **errors,
        **about,
        "status": solution.status,
        "accuracy": solution.accuracy,
        "expected_error": solution.expected_error,
        "estimated_error": solution.estimated_error,
    }
