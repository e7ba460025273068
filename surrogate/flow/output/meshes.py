"""A body's surface as a pyvista mesh: the contour in 2-D, the closed skin in 3-D."""

import os

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.shape import FamilyShape

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")  # no display needed

import pyvista as pv


def outline(markers: Float[AnyArray, "nodes 2"], height: float = 0.0) -> pv.PolyData:
    """Return the contour of a 2-D body as a closed line at the height z = ``height``."""
    points = np.column_stack([markers, np.full(len(markers), height)])
    return pv.lines_from_points(points, close=True)


def skin_mesh(
    shape: FamilyShape, rings: int = 96, azimuths: int = 96
) -> tuple[pv.PolyData, np.ndarray]:
    """Return the surface of a 3-D body as a closed mesh of triangles with outward normals.

    Args:
      shape: the body.
      rings: number of intervals in t from nose to tail.
      azimuths: number of points around the axis.

    Returns:
      The mesh, and area vectors at its points, shape (points, 3), for ``Solution.skin_loads``.
    """
    t = np.pi * np.arange(1, rings) / rings
    around = 2 * np.pi * np.arange(azimuths) / azimuths
    mu, phi = (grid.ravel() for grid in np.meshgrid(np.cos(t), around, indexing="ij"))
    mu, phi = np.concatenate([[1.0], mu, [-1.0]]), np.concatenate([[0.0], phi, [0.0]])
    points, areas = map(np.asarray, shape.body_class.skin_at(shape.values, mu, phi))
    ring = 1 + np.arange((rings - 1) * azimuths).reshape(rings - 1, azimuths)
    here, there = ring, np.roll(ring, -1, axis=1)
    nose, tail = np.zeros(azimuths, int), np.full(azimuths, len(points) - 1)
    triangles = [
        np.stack([nose, there[0], here[0]], axis=1),
        np.stack([here[:-1], there[:-1], there[1:]], axis=2).reshape(-1, 3),
        np.stack([here[:-1], there[1:], here[1:]], axis=2).reshape(-1, 3),
        np.stack([tail, here[-1], there[-1]], axis=1),
    ]
    return pv.PolyData.from_regular_faces(points, np.concatenate(triangles)), areas
