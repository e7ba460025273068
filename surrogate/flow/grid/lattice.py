"""The window's staggered grid, its smooth cut-off, and convection on it (jax-cfd lives here)."""

import dataclasses
import functools

import jax.numpy as jnp
import numpy as np
from jax_cfd.base import advection, boundaries, grids
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray


@dataclasses.dataclass(frozen=True)
class Lattice:
    """A window of ``shape`` cells of size ``step`` (in D); the body's centre is the origin.

    The first axis lies along the stream, one (in the plane) or two (in space) across it.
    ``inlet`` is the number of cells between the window's left edge and the body's centre.
    ``periodic``: the window spans a tunnel from wall to wall, so nothing is cut off across it.
    ``symmetric``: of a flow with mirror planes only the part where all coordinates across are
    positive is kept; a component is odd in its own coordinate across, even in the others, and
    where it is odd its zeros on the mirror plane are not stored. In space it always is.
    """

    shape: tuple[int, ...]
    step: tuple[float, ...]
    inlet: int
    periodic: bool = False
    symmetric: bool = False

    @property
    def dimension(self) -> int:
        return len(self.shape)

    @property
    def grid(self) -> grids.Grid:
        left = -self.inlet * self.step[0]
        ends = [(left, left + self.shape[0] * self.step[0])]
        for cells, step in zip(self.shape[1:], self.step[1:], strict=True):
            low = 0.0 if self.symmetric else -cells * step / 2
            ends.append((low, low + cells * step))
        return grids.Grid(self.shape, domain=tuple(ends))

    @property
    def cell_volume(self) -> float:
        """What a stored cell stands for: with its mirror images in a symmetric window."""
        copies = 2 ** (self.dimension - 1) if self.symmetric else 1
        return float(np.prod(self.step)) * copies

    @property
    def unfolded(self) -> "Lattice":
        """The whole window."""
        if not self.symmetric:
            return self
        shape = (self.shape[0], *(2 * cells for cells in self.shape[1:]))
        return dataclasses.replace(self, shape=shape, symmetric=False)

    def unfold(self, velocity: Float[AnyArray, "axes ..."]) -> Float[Array, "axes ..."]:
        """Velocity on the whole window."""
        if not self.symmetric:
            return jnp.asarray(velocity)
        return jnp.stack([self._mirrored(part, own) for own, part in enumerate(velocity)])

    def _mirrored(self, component, own):
        for axis in range(1, self.dimension):
            image = jnp.flip(component, axis)
            if axis == own:  # odd; the outermost zeros are dropped, those in the middle put in
                image = jnp.roll(-image, -1, axis)
                image = image.at[(slice(None),) * axis + (-1,)].set(0.0)
            component = jnp.concatenate([image, component], axis)
        return component

    def rows(self, height: float) -> int:
        """Rows of cells in a tunnel of this height."""
        return round(height / self.step[1])

    def faces(self) -> tuple[tuple[np.ndarray, ...], ...]:
        """Coordinates (x, y, ...) of the faces that carry u, of those that carry v, ..."""
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
        """Window w on the faces: 1 inside, 0 at the edges, ``band`` D between."""
        return self.profile(self.faces(), band)

    def profile(self, faces: tuple[tuple[np.ndarray, ...], ...], band: float) -> np.ndarray:
        """The same function of position on other faces, a product over the axes."""
        return np.stack(
            [
                functools.reduce(
                    np.multiply.outer, [self._edge(x, axis, band) for axis, x in enumerate(face)]
                )
                for face in faces
            ]
        )

    def _edge(self, coordinate, axis, band):
        """The window's profile along one axis."""
        if axis > 0 and self.periodic:
            return np.ones_like(coordinate)
        low, high = self.grid.domain[axis]
        low = -high if axis > 0 else low
        margin = self.step[axis]
        distance = np.minimum(coordinate - low - margin, high - margin - coordinate)
        s = np.clip(distance / band, 0, 1)
        return s**3 * (10 - 15 * s + 6 * s**2)

    def convect(self, velocity: Float[AnyArray, "axes ..."]) -> Float[Array, "axes ..."]:
        """-div(u u) of a face velocity that vanishes at the window's edges (jax-cfd).

        A symmetric window and one from wall to wall may be treated as periodic as well: v = 0 at
        its top row stands for v = 0 on the centre line or the lower wall, and no flux of u
        crosses either.
        """
        bc = boundaries.periodic_boundary_conditions(self.dimension)
        variables = tuple(
            grids.GridVariable(grids.GridArray(component, offset, self.grid), bc)
            for component, offset in zip(velocity, self.grid.cell_faces, strict=True)
        )
        terms = [term.data for term in advection.convect_linear(variables)]
        if self.symmetric or self.periodic:
            for axis in range(1, self.dimension):
                terms[axis] = terms[axis].at[(slice(None),) * axis + (-1,)].set(0.0)
        return jnp.stack(terms)
