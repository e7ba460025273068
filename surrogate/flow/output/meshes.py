"""A flow as pyvista meshes: its fields, and the body's contour in 2-D or closed skin in 3-D."""

import os

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.shape import FamilyShape
from surrogate.flow.fields import Fields
from surrogate.flow.solution import Solution

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")  # no display needed

import pyvista as pv

RINGS, AZIMUTHS = 96, 96  # of a skin: intervals in t from nose to tail, and points around the axis


def outline(markers: Float[AnyArray, "nodes 2"], height: float = 0.0) -> pv.PolyData:
    """Return the contour of a 2-D body as a closed line at the height z = ``height``."""
    points = np.column_stack([markers, np.full(len(markers), height)])
    return pv.lines_from_points(points, close=True)


def skin_mesh(shape: FamilyShape) -> tuple[pv.PolyData, np.ndarray]:
    """Return the surface of a 3-D body as a closed mesh of triangles with outward normals.

    Args:
      shape: the body.

    Returns:
      The mesh, and area vectors at its points, shape (points, 3), for ``Solution.skin_loads``.
    """
    t = np.pi * np.arange(1, RINGS) / RINGS
    around = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    mu, phi = (grid.ravel() for grid in np.meshgrid(np.cos(t), around, indexing="ij"))
    mu, phi = np.concatenate([[1.0], mu, [-1.0]]), np.concatenate([[0.0], phi, [0.0]])
    points, areas = map(np.asarray, shape.body_class.skin_at(shape.values, mu, phi))
    ring = 1 + np.arange((RINGS - 1) * AZIMUTHS).reshape(RINGS - 1, AZIMUTHS)
    here, there = ring, np.roll(ring, -1, axis=1)
    nose, tail = np.zeros(AZIMUTHS, int), np.full(AZIMUTHS, len(points) - 1)
    triangles = [
        np.stack([nose, there[0], here[0]], axis=1),
        np.stack([here[:-1], there[:-1], there[1:]], axis=2).reshape(-1, 3),
        np.stack([here[:-1], there[1:], here[1:]], axis=2).reshape(-1, 3),
        np.stack([tail, here[-1], there[-1]], axis=1),
    ]
    return pv.PolyData.from_regular_faces(points, np.concatenate(triangles)), areas


def surface_mesh(solution: Solution) -> pv.PolyData:
    """Return the contour of a solved body as a line, or its skin in 3-D, with Cp and Cf."""
    shape = solution.shape
    if shape.dimension == 2:
        surface = solution.surface()
        mesh = outline(surface.markers)
        mesh["Cp"], mesh["Cf"] = surface.cp, surface.cf
        return mesh
    mesh, areas = skin_mesh(shape)
    mesh["Cp"], mesh["Cf"] = solution.skin_loads(mesh.points.astype(float), areas)
    return mesh


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


def compact(values: np.ndarray) -> np.ndarray:
    """Return 3-D fields in single precision, which halves their files, and 2-D ones unchanged."""
    single = values.ndim > 2 and values.dtype == float
    return values.astype(np.float32) if single else values


def _flat(field):
    return compact(field).ravel(order="F")
