"""The window's staggered grid, its smooth cut-off, and convection on it (jax-cfd lives here)."""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jax_cfd.base import advection, boundaries, grids
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray


@dataclasses.dataclass(frozen=True)
class Lattice:
    """A window of ``shape`` cells of size ``step`` (in D); the body's centre is the origin.

    ``inlet`` is the number of cells between the window's left edge and the body's centre.
    ``periodic``: the window spans a tunnel's whole period, so nothing is cut off across it.
    ``symmetric``: only the upper half (y > 0) of a window with a symmetric flow is kept; u is
    even and v odd in y, v = 0 on the centre line is not stored.
    """

    shape: tuple[int, int]
    step: tuple[float, float]
    inlet: int
    periodic: bool = False
    symmetric: bool = False

    @property
    def grid(self) -> grids.Grid:
        left = -self.inlet * self.step[0]
        low = 0.0 if self.symmetric else -self.shape[1] * self.step[1] / 2
        right, top = left + self.shape[0] * self.step[0], low + self.shape[1] * self.step[1]
        return grids.Grid(self.shape, domain=((left, right), (low, top)))

    @property
    def cell_area(self) -> float:
        """Area that a stored cell stands for: with its mirror image in a symmetric window."""
        return self.step[0] * self.step[1] * (2 if self.symmetric else 1)

    @property
    def unfolded(self) -> "Lattice":
        """The whole window."""
        if not self.symmetric:
            return self
        shape = (self.shape[0], 2 * self.shape[1])
        return dataclasses.replace(self, shape=shape, symmetric=False)

    def unfold(self, velocity: Float[AnyArray, "2 nx ny"]) -> Float[Array, "2 nx rows"]:
        """Velocity on the whole window."""
        if not self.symmetric:
            return jnp.asarray(velocity)
        u, v = velocity
        centre = jnp.zeros_like(v[:, :1])
        return jnp.stack(
            [
                jnp.concatenate([u[:, ::-1], u], axis=1),
                jnp.concatenate([-v[:, -2::-1], centre, v], axis=1),
            ]
        )

    def rows(self, height: float) -> int:
        """Rows of cells in a tunnel of this height."""
        return round(height / self.step[1])

    def faces(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Coordinates (x, y) of the faces that carry u, and of those that carry v."""
        origin = [low for low, _ in self.grid.domain]
        return tuple(
            tuple(
                start + (np.arange(cells) + shift) * step
                for start, cells, shift, step in zip(
                    origin, self.shape, offset, self.step, strict=True
                )
            )
            for offset in self.grid.cell_faces
        )

    def cutoff(self, band: float = 1.0) -> np.ndarray:
        """Window w on the faces (2, nx, ny): 1 inside, 0 at the edges, ``band`` D between."""
        return np.stack(
            [np.outer(self.edge(x, 0, band), self.edge(y, 1, band)) for x, y in self.faces()]
        )

    def edge(self, coordinate: np.ndarray, axis: int, band: float = 1.0) -> np.ndarray:
        """The window's profile along one axis."""
        if axis == 1 and self.periodic:
            return np.ones_like(coordinate)
        low, high = self.grid.domain[axis]
        low = -high if axis == 1 else low
        margin = self.step[axis]
        distance = np.minimum(coordinate - low - margin, high - margin - coordinate)
        s = np.clip(distance / band, 0, 1)
        return s**3 * (10 - 15 * s + 6 * s**2)

    def convect(self, velocity: Float[AnyArray, "2 nx ny"]) -> Float[Array, "2 nx ny"]:
        """-div(u u) of a face velocity that vanishes at the window's edges (jax-cfd).

        A symmetric window may be treated as periodic as well: v = 0 at its top row stands for
        v = 0 on the centre line, and no flux of u crosses either.
        """
        bc = boundaries.periodic_boundary_conditions(2)
        variables = tuple(
            grids.GridVariable(grids.GridArray(component, offset, self.grid), bc)
            for component, offset in zip(velocity, self.grid.cell_faces, strict=True)
        )
        along, across = (term.data for term in advection.convect_linear(variables))
        if self.symmetric:
            across = across.at[:, -1].set(0.0)
        return jnp.stack([along, across])
