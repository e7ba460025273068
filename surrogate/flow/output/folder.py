"""The folder of a solved flow: record, contour with Cp and Cf, fields and a picture."""

import json
import zlib
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Float

from surrogate.errors import InvalidInput
from surrogate.files import (
    JsonObject,
    changed_files,
    check_target,
    file_digests,
    path_of,
    strict_json,
    whole_files,
)
from surrogate.flow.fields import Fields
from surrogate.flow.output.meshes import compact, fields_mesh, pv, surface_mesh
from surrogate.flow.output.picture import Picture, draw_flows
from surrogate.flow.solution import Solution
from surrogate.flow.surface.surface import SURFACE_POINTS
from surrogate.repeats import check_record

RECORD = "flow.json"
# What damaged files raise, .npz files those of the last line.
UNREADABLE = (
    *(OSError, ValueError, KeyError, TypeError, RecursionError),
    *(EOFError, BadZipFile, zlib.error),
)
KEYS = ("kind", "dimension", "reynolds", "cd", "cl", "cm")
HEADER = "x,y,Cp,Cf"


class StoredFlow(NamedTuple):
    """The contents of a flow's folder: record, fields, and x, y, Cp, Cf along the contour."""

    record: JsonObject
    fields: Fields
    contour: Float[np.ndarray, "nodes 4"]

    @property
    def picture(self) -> Picture:
        """The flow as a picture to be drawn, with a title of its coefficients."""
        r = self.record
        turned = f"    incidence {r['incidence']:g}\N{DEGREE SIGN}" if r.get("incidence") else ""
        walls = f"    tunnel {r['tunnel_height']:g} D high" if r.get("tunnel_height") else ""
        title = f"Re {r['reynolds']:g}{turned}{walls}    Cd {r['cd']:.4f}"
        if r["cl"] or r["cm"]:
            title += f"    Cl {r['cl']:.4f}    Cm {r['cm']:.4f}"
        title += "    (degraded)" if r.get("status") == "degraded" else ""
        return Picture(title, self.fields, self.contour[:, :2])


def check_flow_folder(folder: str | Path) -> None:
    """Raise InvalidInput unless a flow may be written to the folder."""
    check_target(folder, RECORD, KEYS)


def check_stored_flow(folder: str | Path, asked: JsonObject | None) -> None:
    """Raise InvalidInput unless a flow may be written to the folder, and replaces its equal alone.

    Args:
      folder: to be written.
      asked: entry "settings" that a flow in it must have; None accepts every flow.
    """
    check_flow_folder(folder)
    if asked is not None:
        check_record(path_of(folder) / RECORD, "flow", asked)


def write_flow(solution: Solution, folder: str | Path, notes: JsonObject | None) -> Path:
    """Write a solved flow into a folder, whole or not at all, and return its path.

    Args:
      solution: the flow.
      folder: to be written.
      notes: further entries of the record, if any.

    Raises:
      InvalidInput: the folder holds something else, or is not writable, or a note is no value of
        JSON or has the name of an entry of the record.
    """
    check_flow_folder(folder)
    stored, notes = flow_as_stored(solution), _checked_notes(notes)
    if taken := sorted(set(notes) & set(stored.record)):
        raise InvalidInput(f"notes: the record of a flow has its own {taken[0]}")
    with whole_files(folder, RECORD) as part:
        np.savetxt(part / "contour.csv", stored.contour, "%.9g", ",", header=HEADER, comments="")
        surface_mesh(solution).save(part / "contour.vtp")
        named = {name: compact(values) for name, values in stored.fields.named.items()}
        np.savez_compressed(part / "fields.npz", **named)
        fields_mesh(stored.fields).save(part / "fields.vti")
        draw_flows([stored.picture], part / "flow.png")
        record = stored.record | notes | {"files_sha256": file_digests(part)}
        (part / RECORD).write_text(json.dumps(record, indent=1) + "\n")
    return Path(folder)


def _checked_notes(notes):
    """Return the notes, which must be of JSON."""
    try:
        return json.loads(json.dumps(notes or {}, allow_nan=False))
    except (TypeError, ValueError) as problem:
        raise InvalidInput(f"notes: must be values of JSON ({problem})") from None


def flow_as_stored(solution: Solution) -> StoredFlow:
    """Return the contents that ``write_flow`` stores of a solved flow, without writing them."""
    return StoredFlow(_record(solution), solution.fields, _contour(solution))


def is_flow(folder: str | Path) -> bool:
    """Return whether a folder holds the record of a flow."""
    return (path_of(folder) / RECORD).is_file()


def read_flow(folder: str | Path) -> StoredFlow:
    """Return the flow that ``write_flow`` stored in a folder.

    Raises:
      InvalidInput: the folder has no readable flow.
    """
    folder = path_of(folder)
    try:
        record = _record_of_files(folder, "fields.npz", "contour.csv")
        names = "xyz"[: record["dimension"]]
        with np.load(folder / "fields.npz") as file:
            axes = tuple(file[name] for name in names)
            velocity = np.stack([file[name] for name in "uvw"[: record["dimension"]]])
            fields = Fields(axes, velocity, file["p"], file["vorticity"], file["inside"])
        lines = (folder / "contour.csv").read_text(encoding="utf-8").splitlines()[1:]
        contour = np.array([line.split(",") for line in lines], float)
        stored = StoredFlow(record, fields, contour)
        _check(stored)
        return stored
    except UNREADABLE as problem:
        raise _unreadable(folder, problem) from None


def _record_of_files(folder: Path, *names: str) -> JsonObject:
    """Return the record of a flow's folder.

    Raises:
      ValueError: it is no such record, or one of these files is not what was written with it.
      OSError: the record, or one of the files, cannot be read.
    """
    record = strict_json((folder / RECORD).read_text(encoding="utf-8"))
    if missing := sorted(set(KEYS) - set(record)):
        raise ValueError(f"{RECORD} lacks {missing[0]}")
    digests = record.get("files_sha256", {})  # earlier versions wrote none
    if changed := changed_files(folder, {name: digests[name] for name in names if name in digests}):
        raise ValueError(f"{changed[0]} is not what was written with {RECORD}")
    return record


def _check(stored: StoredFlow) -> None:
    """Raise ValueError or TypeError where numbers, or the shapes of arrays, are not of a flow."""
    fields, cells = stored.fields, tuple(map(len, stored.fields.axes))
    numbers = [stored.record[key] for key in KEYS[1:]] + [stored.record.get("incidence") or 0.0]
    if not np.isfinite(np.array(numbers, float)).all():
        raise ValueError(f"{RECORD} has coefficients that are no numbers")
    shapes = {part.shape for part in (*fields.velocity, fields.p, fields.inside)}
    if shapes != {cells} or fields.vorticity.shape[-len(cells) :] != cells or min(cells) < 2:
        raise ValueError("fields.npz has arrays of different grids")
    if stored.contour.shape[1:] != (4,) or len(stored.contour) < 3:
        raise ValueError("contour.csv has no contour with Cp and Cf")


def read_surface(folder: str | Path) -> pv.PolyData:
    """Return the contour, or the skin of a 3-D body, with Cp and Cf that ``write_flow`` stored.

    Raises:
      InvalidInput: the folder has no readable one.
    """
    folder = path_of(folder)
    try:
        _record_of_files(folder, "contour.vtp")
        surface = pv.read(folder / "contour.vtp")
        if not {"Cp", "Cf"} <= set(surface.point_data):
            raise ValueError("contour.vtp has no Cp and Cf")
    except UNREADABLE as problem:
        raise _unreadable(folder, problem) from None
    return surface


def _unreadable(folder: str | Path, problem: Exception) -> InvalidInput:
    return InvalidInput(f"flow {folder}: cannot be read ({' '.join(str(problem).split())})")


def _contour(solution: Solution) -> Float[np.ndarray, "nodes 4"]:
    """Return x, y, Cp, Cf along the contour; of a 3-D body in its plane y = 0, z for y."""
    shape = solution.shape
    if shape.dimension == 2:
        surface = solution.surface()
        return np.column_stack([surface.markers, surface.cp, surface.cf])
    t = 2 * np.pi * np.arange(SURFACE_POINTS) / SURFACE_POINTS
    side = np.where(t <= np.pi, np.pi / 2, -np.pi / 2)
    points, areas = map(np.asarray, shape.body_class.skin_at(shape.values, np.cos(t), side))
    loads = solution.skin_loads(points, areas)
    normal = areas / np.linalg.norm(areas, axis=1, keepdims=True)
    along = loads.friction[:, 0] * normal[:, 2] - loads.friction[:, 2] * normal[:, 0]
    return np.column_stack([points[:, 0], points[:, 2], loads.cp, along])


def _record(s: Solution) -> JsonObject:
    names = {"drag": "cd", "drag_pressure": "cd_pressure", "drag_friction": "cd_friction"}
    names |= {"lift": "cl", "moment": "cm", "reynolds": "reynolds", "status": "status"}
    same = ("expected_error", "estimated_error", "estimated_lift_error", "estimated_moment_error")
    names |= {name: name for name in (*same, "chord", "green_applications")}
    found = {key: getattr(s, name) for name, key in names.items()}
    body = s.shape.parameters and dict(s.shape.parameters)
    return {
        "kind": "flow",
        "reference": "diameter",  # of all coefficients
        "dimension": s.shape.dimension,
        **found,
        "onset": s.onset,
        "parameters": body,
        "incidence": s.shape.incidence,
        "tunnel_height": s.domain.height,
        "cells": s.fidelity.cells,
        "grid": list(s.domain.lattice.unfolded.shape),
    }
