"""The fields of a solved flow at the centres of its cells: velocity, pressure and vorticity."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import shapely
from jaxtyping import Bool, Float

from surrogate.arrays import AnyArray
from surrogate.body.incidence import rotate
from surrogate.body.shape import Shape
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.surface.forces_2d import vorticity
from surrogate.flow.surface.forces_3d import curl

NODES = 400  # of the contour within which cells are inside the body


@dataclasses.dataclass(frozen=True, eq=False)
class Fields:
    """Fields at the cell centres of the whole grid, mirror images included, indexed [i, j(, k)].

    They cover the computational domain but for its outermost cells, where differences have no
    neighbours. Within two cells of the wall they are smeared by the immersed boundary; values
    inside the body are kept and mean nothing. The convection of the perturbation is blended out
    over the last 1 D before the edges (not across a tunnel), so pressure is best within.

    Attributes:
      axes: coordinates x, y(, z) of the centres in D, one array for each axis.
      velocity: u, v(, w) over U, the stream included.
      p: pressure over rho U^2, zero far upstream; Cp is twice that.
      vorticity: over U / D; in 2-D its one component, positive anticlockwise, in 3-D all three.
      inside: whether a cell's centre lies inside the body.
    """

    axes: tuple[Float[np.ndarray, " _cells"], ...]
    velocity: Float[np.ndarray, "axes ..."]
    p: Float[np.ndarray, "..."]
    vorticity: Float[np.ndarray, "..."]
    inside: Bool[np.ndarray, "..."]

    @property
    def named(self) -> dict[str, np.ndarray]:
        """All arrays by the names that they have in files."""
        axes = dict(zip("xyz", self.axes, strict=False))
        velocity = dict(zip("uvw", self.velocity, strict=False))
        rest = {"p": self.p, "vorticity": self.vorticity, "inside": self.inside}
        return axes | velocity | rest


def fields_of(
    domain: Domain,
    shape: Shape,
    velocity: Float[AnyArray, "axes ..."],
    p: Float[np.ndarray, "..."],
) -> Fields:
    """Return the fields of a flow at the centres of its cells.

    Args:
      domain: of the flow.
      shape: the body.
      velocity: on the faces of the whole lattice, mirror images and the stream included.
      p: pressure over rho U^2 in the cells of the whole lattice.
    """
    lattice = domain.lattice.unfolded
    inner = (slice(1, -1),) * lattice.dimension
    axes = tuple(
        low + (np.arange(1, cells - 1) + 0.5) * step
        for (low, _), cells, step in zip(
            lattice.grid.domain, lattice.shape, lattice.step, strict=True
        )
    )
    velocity = np.asarray(velocity)
    middle = np.stack([_averaged(part, (own,))[inner] for own, part in enumerate(velocity)])
    return Fields(
        axes, middle, p[inner], _central_vorticity(lattice, velocity), inside(shape, axes)
    )


def polygon_of(shape: Shape) -> shapely.Polygon:
    """Return the contour of a 2-D body as it lies in the stream, as a polygon."""
    return shapely.Polygon(shape.draw(NODES))


def inside(shape: Shape, axes: tuple[Float[np.ndarray, " _cells"], ...]) -> Bool[np.ndarray, "..."]:
    """Return which points of a grid lie inside a body, as an array over the grid."""
    grid = np.meshgrid(*axes, indexing="ij", sparse=True)
    if shape.dimension == 2:
        return shapely.contains_xy(polygon_of(shape), *np.broadcast_arrays(*grid))
    contour = rotate(shape.draw(NODES), -shape.incidence)
    upper = contour[contour[:, 1] >= 0]
    upper = upper[np.argsort(upper[:, 0])]
    x, y, z = grid
    angle = np.deg2rad(shape.incidence)
    along, high = x * np.cos(angle) - z * np.sin(angle), x * np.sin(angle) + z * np.cos(angle)
    height = np.interp(along, *upper.T, left=0.0, right=0.0)
    return (y / shape.parameters.get("flatness", 1.0)) ** 2 + high**2 < height**2


def _central_vorticity(lattice: Lattice, velocity: np.ndarray) -> np.ndarray:
    """Return the vorticity at the inner cells' centres, the mean over their corners or edges."""
    inner = (slice(1, -1),) * lattice.dimension
    if lattice.dimension == 2:
        return _averaged(np.asarray(vorticity(lattice, jnp.asarray(velocity))), (0, 1))[inner]
    spin = np.asarray(curl(velocity, lattice.step[0]))
    across = ((1, 2), (0, 2), (0, 1))
    return np.stack([_averaged(w, axes)[inner] for w, axes in zip(spin, across, strict=True)])


def _averaged(field: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Return the means of neighbours, from the upper faces to the centres along ``axes``."""
    for axis in axes:
        field = (field + np.roll(field, 1, axis)) / 2
    return field
