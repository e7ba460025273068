"""Bodies as meshes of pyvista, which draws and writes them without a display."""

import os

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")  # no display needed

import pyvista as pv

Markers = Float[AnyArray, "nodes 2"]


def polygon(markers: Markers, height: float = 0.0) -> pv.PolyData:
    """A body's area as triangles."""
    points = np.column_stack([markers, np.full(len(markers), height)])
    return pv.PolyData(points, faces=[len(points), *range(len(points))]).triangulate()


def outline(markers: Markers, height: float = 0.0) -> pv.PolyData:
    """A body's contour as a closed line."""
    points = np.column_stack([markers, np.full(len(markers), height)])
    return pv.lines_from_points(points, close=True)


def solid(markers: Markers, span: float = 1.0) -> pv.PolyData:
    """The body extruded over ``span``: a closed surface of triangles, their normals outward.

    ``markers`` go once around a clockwise contour.
    """
    block = polygon(markers).extrude((0, 0, float(span)), capping=True).triangulate().clean()
    return block.compute_normals(
        point_normals=False, consistent_normals=True, auto_orient_normals=True
    )
