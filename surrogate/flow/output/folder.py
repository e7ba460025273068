"""The folder of a solved flow: record, contour with Cp and Cf, fields and a picture."""

import dataclasses
import json
import zlib
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Float

from surrogate.body.shape import FamilyShape, Shape
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject, check_target, path_of, strict_json, whole_files
from surrogate.flow.fields import Fields
from surrogate.flow.output.meshes import outline, pv, skin_mesh
from surrogate.flow.output.picture import Picture, draw_flows
from surrogate.flow.solution import Solution
from surrogate.flow.surface.surface import SURFACE_POINTS

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
        turned = f"    incidence {r['incidence']:g}" if r.get("incidence") else ""
        title = f"Re {r['reynolds']:g}{turned}    Cd {r['cd']:.4f}"
        if r["cl"] or r["cm"]:
            title += f"    Cl {r['cl']:.4f}    Cm {r['cm']:.4f}"
        return Picture(title, self.fields, self.contour[:, :2])


def check_flow_folder(folder: str | Path) -> None:
    """Raise InvalidInput unless a flow may be written to the folder."""
    check_target(folder, RECORD, KEYS)


def write_flow(solution: Solution, folder: str | Path) -> Path:
    """Write a solved flow into a folder, whole or not at all, and return its path.

    Raises:
      InvalidInput: the folder holds something else, or is not writable.
    """
    check_flow_folder(folder)
    stored = flow_as_stored(solution)
    with whole_files(folder, RECORD) as part:
        np.savetxt(part / "contour.csv", stored.contour, "%.9g", ",", header=HEADER, comments="")
        _surface_mesh(solution, stored.contour).save(part / "contour.vtp")
        named = {name: _compact(values) for name, values in stored.fields.named.items()}
        np.savez_compressed(part / "fields.npz", **named)
        fields_mesh(stored.fields).save(part / "fields.vti")
        draw_flows([stored.picture], part / "flow.png")
        (part / RECORD).write_text(json.dumps(stored.record, indent=1) + "\n")
    return Path(folder)


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
        record = strict_json((folder / RECORD).read_text(encoding="utf-8"))
        if not set(KEYS) <= set(record):
            raise ValueError
        names = "xyz"[: record["dimension"]]
        with np.load(folder / "fields.npz") as file:
            axes = tuple(file[name] for name in names)
            velocity = np.stack([file[name] for name in "uvw"[: record["dimension"]]])
            fields = Fields(axes, velocity, file["p"], file["vorticity"], file["inside"])
        contour = np.loadtxt(folder / "contour.csv", delimiter=",", skiprows=1)
        return StoredFlow(record, fields, contour)
    except UNREADABLE as problem:
        raise _unreadable(folder, problem) from None


def read_surface(folder: str | Path) -> pv.PolyData:
    """Return the contour, or the skin of a 3-D body, with Cp and Cf that ``write_flow`` stored.

    Raises:
      InvalidInput: the folder has no readable one.
    """
    try:
        surface = pv.read(path_of(folder) / "contour.vtp")
        if not {"Cp", "Cf"} <= set(surface.point_data):
            raise ValueError("contour.vtp has no Cp and Cf")
    except (OSError, ValueError) as problem:
        raise _unreadable(folder, problem) from None
    return surface


def _unreadable(folder: str | Path, problem: Exception) -> InvalidInput:
    return InvalidInput(f"flow {folder}: cannot be read ({' '.join(str(problem).split())})")


def fields_mesh(fields: Fields) -> pv.ImageData:
    """Return the fields as a uniform grid whose points are the cells' centres."""
    axes = [*fields.axes, np.zeros(1)][:3]
    mesh = pv.ImageData(
        dimensions=tuple(map(len, axes)),
        spacing=[x[1] - x[0] if len(x) > 1 else 1.0 for x in axes],
        origin=[x[0] for x in axes],
    )
    velocity = [_flat(part) for part in fields.velocity]
    mesh["velocity"] = np.stack([*velocity, np.zeros_like(velocity[0])][:3], axis=1)
    for name, part in zip("uvw", velocity, strict=False):
        mesh[name] = part
    mesh["p"], mesh["inside"] = _flat(fields.p), fields.inside.ravel(order="F").astype(np.uint8)
    spin = fields.vorticity
    if len(fields.axes) == 3:
        mesh["vorticity"] = np.stack([_flat(part) for part in spin], axis=1)
    else:
        mesh["vorticity"] = _flat(spin)
    return mesh


def _flat(field):
    return _compact(field).ravel(order="F")


def _compact(values):
    """Return 3-D fields in single precision, in which they are a third as large as their grid."""
    single = values.ndim > 2 and values.dtype == float
    return values.astype(np.float32) if single else values


def _contour(solution: Solution) -> Float[np.ndarray, "nodes 4"]:
    """Return x, y, Cp, Cf along the contour; of a 3-D body in its plane y = 0, z for y."""
    shape = solution.shape
    if shape.dimension == 2:
        surface = solution.surface()
        return np.column_stack([surface.markers, surface.cp, surface.cf])
    t = 2 * np.pi * np.arange(SURFACE_POINTS) / SURFACE_POINTS
    side = np.where(t <= np.pi, np.pi / 2, -np.pi / 2)
    points, areas = map(
        np.asarray, _family(shape).body_class.skin_at(shape.values, np.cos(t), side)
    )
    loads = solution.skin_loads(points, areas)
    normal = areas / np.linalg.norm(areas, axis=1, keepdims=True)
    along = loads.friction[:, 0] * normal[:, 2] - loads.friction[:, 2] * normal[:, 0]
    return np.column_stack([points[:, 0], points[:, 2], loads.cp, along])


def _surface_mesh(solution: Solution, contour: np.ndarray) -> pv.PolyData:
    """Return the contour as a line, or the closed skin of a 3-D body, with Cp and Cf."""
    if solution.shape.dimension == 3:
        mesh, areas = skin_mesh(_family(solution.shape))
        mesh["Cp"], mesh["Cf"] = solution.skin_loads(mesh.points.astype(float), areas)
        return mesh
    mesh = outline(contour[:, :2])
    mesh["Cp"], mesh["Cf"] = contour[:, 2:].T
    return mesh


def _family(shape: Shape) -> FamilyShape:
    if not isinstance(shape, FamilyShape):
        raise InvalidInput("write: a 3-D body must be one of a family")
    return shape


def _record(s: Solution) -> JsonObject:
    names = {"drag": "cd", "drag_pressure": "cd_pressure", "drag_friction": "cd_friction"}
    names |= {"lift": "cl", "moment": "cm", "reynolds": "reynolds", "status": "status"}
    names |= {"estimated_error": "estimated_error", "green_applications": "green_applications"}
    found = {key: getattr(s, name) for name, key in names.items()}
    body = s.shape.parameters and dict(s.shape.parameters)
    return {
        "kind": "flow",
        "dimension": s.shape.dimension,
        **found,
        "onset": s.onset,
        "parameters": body,
        "incidence": s.shape.incidence,
        "tunnel_height": s.domain.height,
        "cells": dataclasses.astuple(s.domain.lattice.unfolded)[0],
    }
