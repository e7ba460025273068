"""Meshes of the finite elements (NGSolve) round bodies in boxes; lengths in D."""

from typing import Any, NamedTuple

import numpy as np

from surrogate import Shape
from surrogate.body.shape import FamilyShape


class Elements(NamedTuple):
    """The resolution of a mesh: degree of the elements, half extent of the box, and their widths.

    The widths are on the body, near it, and in its wake. The region near the body ends ``margin``
    from it, and 2 D behind it.
    """

    order: int = 3
    box: float = 100.0
    wall: float = 0.05
    near: float = 0.2
    wake: float = 1.0
    margin: float = 1.0


def half_plane(ng: Any, body: Shape, elements: Elements) -> Any:
    """Return triangles of the half plane above a body's axis: (x, y) in 2-D, (x, r) in 3-D.

    In 3-D the body is one of revolution.
    """
    from netgen import occ

    def box(start, end, height, width):
        face = occ.MoveTo(start, 0).Rectangle(end - start, height).Face()
        face.faces.maxh = width
        return face

    outline, extent = np.asarray(body.draw(400)), elements.box
    skin = _inside(occ, outline, elements.wall)
    (nose, _), (tail, high) = outline.min(axis=0), outline.max(axis=0)
    margin = elements.margin
    near = box(nose - margin, tail + 2, high + margin, elements.near)
    wake = box(tail + 2, extent, high + 2, elements.wake)
    far = box(-extent, extent, extent, extent / 8)
    whole = occ.Glue([near - skin, wake, far - near - wake])
    _name_sides(whole.edges, extent, ("axis",))
    return _mesh(ng, _triangles(occ, whole, outline, elements.wall), elements)


def whole_plane(ng: Any, body: Shape, elements: Elements) -> Any:
    """Return triangles of the plane around a body as it lies."""
    from netgen import occ

    def box(start, end, low, high, width):
        face = occ.MoveTo(start, low).Rectangle(end - start, high - low).Face()
        face.faces.maxh = width
        return face

    outline, extent = np.asarray(body.draw(400)), elements.box
    skin = _inside(occ, outline, elements.wall)
    (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
    margin = elements.margin
    near = box(left - margin, right + 2, low - margin, high + margin, elements.near)
    wake = box(right + 2, extent, low - 2, high + 2, elements.wake)
    far = box(-extent, extent, -extent, extent, extent / 8)
    whole = occ.Glue([near - skin, wake, far - near - wake])
    _name_sides(whole.edges, extent)
    return _mesh(ng, _triangles(occ, whole, outline, elements.wall), elements)


def quarter(ng: Any, body: FamilyShape, elements: Elements) -> Any:
    """Return tetrahedra of the quarter y, z > 0 round a flattened body with two mirror planes."""
    return _space(ng, body, elements, ("flank", "floor"))


def half(ng: Any, body: FamilyShape, elements: Elements) -> Any:
    """Return tetrahedra of the half y > 0 round a body at incidence."""
    return _space(ng, body, elements, ("flank",))


def _space(ng: Any, body: FamilyShape, elements: Elements, mirrors: tuple[str, ...]) -> Any:
    """Tetrahedra of the part of space on one side of the mirror planes y = 0, z = 0."""
    from netgen import occ

    def box(start, end, sides, width):
        low = (-side if axis >= len(mirrors) else 0 for axis, side in enumerate(sides))
        solid = occ.Box((start, *low), (end, *sides))
        solid.maxh = width
        return solid

    upright = np.asarray(body.body_class.outline(body.values, 100))
    (length, height), extent = np.ptp(upright, axis=0), elements.box
    upper = occ.MoveTo(-length, 0).Rectangle(2 * length, height).Face()
    profile = upper * _inside(occ, upright, elements.wall)
    solid = profile.Revolve(occ.Axis((0, 0, 0), occ.X), 360)
    flatness = body.parameters.get("flatness", 1.0)
    skin = occ.gp_GTrsf(mat=[1, 0, 0, 0, flatness, 0, 0, 0, 1])(solid)
    skin = skin.Rotate(occ.Axis((0, 0, 0), occ.Y), body.incidence)
    for face in skin.faces:
        face.name, face.maxh = "body", elements.wall
    length, width, height = body.extent / 2
    margin = elements.margin
    near = box(-length - margin, length + 2, (width + margin, height + margin), elements.near)
    wake = box(length + 2, extent, (width + 2, height + 2), elements.wake)
    far = box(-extent, extent, (extent, extent), extent / 6)
    whole = occ.Glue([near - skin, wake, far - near - wake])
    _name_sides(whole.faces, extent, mirrors, 3)
    return _mesh(ng, occ.OCCGeometry(whole).GenerateMesh(grading=0.3), elements)


def _triangles(occ: Any, faces: Any, outline: np.ndarray, wall: float) -> Any:
    """Triangles of the faces, on the body no wider than its radius of curvature."""
    from netgen.meshing import MeshingParameters

    points = outline @ np.array([1, 1j])
    behind, ahead = points - np.roll(points, 1), np.roll(points, -1) - points
    turn = np.abs(np.angle(ahead * behind.conj()))
    radii = (np.abs(ahead) + np.abs(behind)) / np.maximum(2 * turn, 1e-12)
    parameters = MeshingParameters(grading=0.25)
    for (x, y), radius in zip(outline.tolist(), radii.tolist(), strict=True):
        if radius < wall:
            parameters.RestrictH(x, y, 0, radius)
    return occ.OCCGeometry(faces, dim=2).GenerateMesh(parameters)


def _name_sides(
    sides: Any, extent: float, mirrors: tuple[str, ...] = (), dimension: int = 2
) -> None:
    """Name the outlet, the other sides of the box, and the planes of symmetry if there are any."""
    for side in sides:
        x, *across = list(side.center)[:dimension]
        if x > extent - 1e-6:
            side.name = "outlet"
        elif max(-x, *map(abs, across)) > extent - 1e-6:
            side.name = "stream"
        elif mirrors and min(across[: len(mirrors)]) < 1e-6:
            side.name = mirrors[np.argmin(across[: len(mirrors)])]


def _mesh(ng: Any, mesh: Any, elements: Elements) -> Any:
    """A mesh with curved elements at the body."""
    curved = ng.Mesh(mesh)
    curved.Curve(elements.order)
    return curved


def _inside(occ: Any, outline: np.ndarray, wall: float) -> Any:
    """Return the face inside the body, whose edges are splines from nose to tail and back.

    With one edge for both sides netgen would put points of one side of a sharp tail on the other.
    """
    points = [occ.Pnt(x, y, 0) for x, y in outline]
    tail = int(np.argmax(np.linalg.norm(outline - outline[0], axis=1)))
    sides = points[: tail + 1], [*points[tail:], points[0]]
    face = occ.Face(occ.Wire([occ.SplineInterpolation(side) for side in sides]))
    for edge in face.edges:
        edge.name, edge.maxh = "body", wall
    return face
