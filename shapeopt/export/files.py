"""A body for other programs: contour with its loads (.vtp, ParaView) and solid (.stl, CAD)."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from shapeopt.export.solid import outline, skin_mesh, solid
from surrogate.arrays import AnyArray
from surrogate.body.shape import Shape
from surrogate.files import whole_file
from surrogate.flow.solution import Solution
from surrogate.flow.surface.surface import Surface


def write_contour_csv(markers: Float[AnyArray, "nodes 2"], path: str | Path) -> Path:
    """Rows of x,y in D, once around, clockwise from the nose."""
    with whole_file(path) as part:
        np.savetxt(part, np.asarray(markers), "%.9f", ",", header="x,y", comments="")
    return Path(path)


def write_contour_vtp(
    markers: Float[AnyArray, "nodes 2"], path: str | Path, surface: Surface | None = None
) -> Path:
    """The contour as a closed line; with its ``surface`` loads, Cp and Cf as point data."""
    mesh = outline(markers if surface is None else surface.markers)
    if surface is not None:
        mesh["Cp"], mesh["Cf"] = surface.cp, surface.cf
    with whole_file(path) as part:
        mesh.save(part)
    return Path(path)


def write_solid_stl(
    markers: Float[AnyArray, "nodes 2"], path: str | Path, span: float = 1.0
) -> Path:
    """The body extruded over ``span`` (D), closed and watertight, as binary STL."""
    with whole_file(path) as part:
        solid(markers, span).save(part)
    return Path(path)


def write_skin(
    shape: Shape, vtp: str | Path, stl: str | Path, solution: Solution | None = None
) -> None:
    """The closed skin of a body in space as .vtp and binary STL.

    With its ``solution`` Cp and the friction vector Cf are point data of the .vtp.
    """
    mesh, areas = skin_mesh(shape)
    with whole_file(stl) as part:
        mesh.save(part)
    if solution is not None:
        mesh["Cp"], mesh["Cf"] = solution.skin_loads(mesh.points.astype(float), areas)
    with whole_file(vtp) as part:
        mesh.save(part)
