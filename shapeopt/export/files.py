"""Files of a body for other programs: contour (.csv), surface (.vtp, ParaView), solid (.stl)."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from shapeopt.export.solid import solid
from surrogate.arrays import AnyArray
from surrogate.body.shape import Shape
from surrogate.files import whole_file
from surrogate.flow.output.meshes import outline, skin_mesh
from surrogate.flow.solution import Solution
from surrogate.flow.surface.surface import Surface


def write_contour_csv(markers: Float[AnyArray, "nodes 2"], path: str | Path) -> Path:
    """Write the contour, clockwise from the nose, as CSV rows of x,y in D, and return the path."""
    with whole_file(path) as part:
        np.savetxt(part, np.asarray(markers), "%.9f", ",", header="x,y", comments="")
    return Path(path)


def write_contour_vtp(
    markers: Float[AnyArray, "nodes 2"], path: str | Path, surface: Surface | None = None
) -> Path:
    """Write the contour as a closed line in a .vtp file for ParaView, and return the path.

    With ``surface`` its markers are written instead, with Cp and Cf as point data.
    """
    mesh = outline(markers if surface is None else surface.markers)
    if surface is not None:
        mesh["Cp"], mesh["Cf"] = surface.cp, surface.cf
    with whole_file(path) as part:
        mesh.save(part)
    return Path(path)


def write_solid_stl(markers: Float[AnyArray, "nodes 2"], path: str | Path) -> Path:
    """Write the body extruded over a span of 1 D as a closed binary STL, and return the path."""
    with whole_file(path) as part:
        solid(markers).save(part)
    return Path(path)


def write_skin(
    shape: Shape, vtp: str | Path, stl: str | Path, solution: Solution | None = None
) -> None:
    """Write the closed surface of a 3-D body as .vtp and binary STL.

    Args:
      shape: the body.
      vtp: path of the .vtp file.
      stl: path of the STL file.
      solution: of the flow past it; if given, Cp and the friction vector Cf are point data of the
        .vtp.
    """
    mesh = skin_mesh(shape)[0] if solution is None else solution.surface_mesh()
    with whole_file(stl) as part:
        mesh.save(part)
    with whole_file(vtp) as part:
        mesh.save(part)
