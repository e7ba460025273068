"""Meshes of the finite elements (NGSolve) round bodies in boxes; lengths in D."""

from typing import Any, NamedTuple

import numpy as np

from surrogate import Shape


class Elements(NamedTuple):
    """Degree of the elements, half extent of the box, and element widths.

    The widths are on the body, near it, and in its wake.
    """

    order: int = 3
    box: float = 100.0
    wall: float = 0.05
    near: float = 0.2
    wake: float = 1.0


def half_plane(ng: Any, body: Shape, elements: Elements) -> Any:
    """Triangles of the half plane above the body's axis: (x, y) in 2-D, (x, r) of revolution."""
    from netgen import occ

    def box(start, end, height, width):
        face = occ.MoveTo(start, 0).Rectangle(end - start, height).Face()
        face.faces.maxh = width
        return face

    outline = np.asarray(body.draw(400))
    skin = _spline(occ, outline)
    skin.name, skin.maxh = "body", elements.wall
    extent, (nose, _), (tail, high) = elements.box, outline.min(axis=0), outline.max(axis=0)
    near = box(nose - 1, tail + 2, high + 1, elements.near)
    wake = box(tail + 2, extent, high + 2, elements.wake)
    far = box(-extent, extent, extent, extent / 8)
    whole = occ.Glue([near - occ.Face(occ.Wire([skin])), wake, far - near - wake])
    for edge in whole.edges:
        x, r, _ = edge.center
        if r < 1e-6:
            edge.name = "axis"
        elif x > extent - 1e-6:
            edge.name = "outlet"
        elif max(-x, r) > extent - 1e-6:
            edge.name = "stream"
    mesh = ng.Mesh(occ.OCCGeometry(whole, dim=2).GenerateMesh(grading=0.25))
    mesh.Curve(elements.order)
    return mesh


def quarter(ng: Any, body: Shape, elements: Elements) -> Any:
    """Tetrahedra of the quarter y, z > 0 round a flattened body with two mirror planes."""
    from netgen import occ

    def box(start, end, sides, width):
        solid = occ.Box((start, 0, 0), (end, *sides))
        solid.maxh = width
        return solid

    skin = _solid(occ, body)
    for face in skin.faces:
        face.name, face.maxh = "body", elements.wall
    length, width, height = body.reach / 2
    near = box(-length - 1, length + 2, (width + 1, height + 1), elements.near)
    wake = box(length + 2, elements.box, (width + 2, height + 2), elements.wake)
    far = box(-elements.box, elements.box, (elements.box, elements.box), elements.box / 6)
    whole = occ.Glue([near - skin, wake, far - near - wake])
    for face in whole.faces:
        (x, y, z), extent = face.center, elements.box - 1e-6
        if x > extent:
            face.name = "outlet"
        elif max(-x, y, z) > extent:
            face.name = "stream"
        elif y < 1e-6:
            face.name = "flank"
        elif z < 1e-6:
            face.name = "floor"
    mesh = ng.Mesh(occ.OCCGeometry(whole).GenerateMesh(grading=0.3))
    mesh.Curve(elements.order)
    return mesh


def _solid(occ: Any, body: Shape) -> Any:
    """The body: its outline turned round the axis, then stretched to its width."""
    length, width, height = body.reach
    upper = occ.MoveTo(-length, 0).Rectangle(2 * length, height).Face()
    half = upper * occ.Face(occ.Wire([_spline(occ, np.asarray(body.draw(100)))]))
    solid = half.Revolve(occ.Axis((0, 0, 0), occ.X), 360)
    return occ.gp_GTrsf(mat=[1, 0, 0, 0, width / height, 0, 0, 0, 1])(solid)


def _spline(occ: Any, outline: np.ndarray) -> Any:
    """A closed curve through the points."""
    return occ.SplineInterpolation([occ.Pnt(x, r, 0) for x, r in outline], periodic=True)
