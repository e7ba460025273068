"""Bodies as pyvista meshes."""

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.output.meshes import pv

Markers = Float[AnyArray, "nodes 2"]


def polygon(markers: Markers, height: float = 0.0) -> pv.PolyData:
    """Return the area of a 2-D body as a mesh of triangles at the height z = ``height``."""
    points = np.column_stack([markers, np.full(len(markers), height)])
    return pv.PolyData(points, faces=[len(points), *range(len(points))]).triangulate()


def solid(markers: Markers) -> pv.PolyData:
    """Return a 2-D body extruded over 1 D as a closed mesh of triangles with outward normals.

    ``markers`` are the contour, clockwise.
    """
    block = polygon(markers).extrude((0, 0, 1.0), capping=True).triangulate().clean()
    return block.compute_normals(
        point_normals=False, consistent_normals=True, auto_orient_normals=True
    )
