"""The staggered grid, its blending function, and convection on it by jax-cfd."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
from jax_cfd.base import advection, boundaries, grids
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray


def mirror_image(velocity: Float[AnyArray, "axes ..."], axis: int) -> Float[Array, "axes ..."]:
    """Return the mirror image of a velocity on faces across the middle of an axis.

    The faces of the component along the axis are not symmetric about the middle: one more lies at
    the upper end, which has no image; its place has a zero, as every blended source has there.

    Args:
      velocity: or another vector field on faces.
      axis: across which it is mirrored, 0 being the one along the stream.
    """
    return jnp.stack([_image(part, own, axis) for own, part in enumerate(velocity)])


def _image(component, own, axis):
    """Return component ``own`` of a velocity's mirror image."""
    image = jnp.flip(component, axis)
    if axis == own:
        image = jnp.roll(-image, -1, axis)
        image = image.at[(slice(None),) * axis + (-1,)].set(0.0)
    return image


@dataclasses.dataclass(frozen=True)
class Lattice:
    """A staggered grid of ``shape`` cells of size ``step`` in D, the body's centre at the origin.

    The first axis lies along the stream, one (2-D) or two (3-D) across it.

    Attributes:
      shape: number of cells along each axis.
      step: cell size along each axis, in D.
      inlet: number of cells between the upstream edge and the body's centre.
      periodic: the grid spans a tunnel from wall to wall, so nothing is blended out across it.
      folded: axes across which the flow has a mirror plane; only its part where their coordinates
        are positive is stored. A component is odd in its own coordinate and even in the others;
        where it is odd its zeros on the mirror plane are not stored.
    """

    shape: tuple[int, ...]
    step: tuple[float, ...]
    inlet: int
    periodic: bool = False
    folded: tuple[int, ...] = ()

    @property
    def dimension(self) -> int:
        """The number of axes."""
        return len(self.shape)

    @property
    def grid(self) -> grids.Grid:
        """The grid as jax-cfd describes it."""
        left = -self.inlet * self.step[0]
        ends = [(left, left + self.shape[0] * self.step[0])]
        for axis in range(1, self.dimension):
            side = self.shape[axis] * self.step[axis]
            low = 0.0 if axis in self.folded else -side / 2
            ends.append((low, low + side))
        return grids.Grid(self.shape, domain=tuple(ends))

    @property
    def cell_volume(self) -> float:
        """The volume of a cell, its mirror images included."""
        return float(np.prod(self.step)) * 2 ** len(self.folded)

    @property
    def unfolded(self) -> "Lattice":
        """The whole grid, of which a folded one is a part."""
        shape = (n * (2 if axis in self.folded else 1) for axis, n in enumerate(self.shape))
        return dataclasses.replace(self, shape=tuple(shape), folded=())

    @functools.partial(jax.jit, static_argnums=0, inline=True)
    def unfold(self, velocity: Float[AnyArray, "axes ..."]) -> Float[Array, "axes ..."]:
        """Return a velocity on the whole grid, mirror images included."""
        return jnp.stack([self._mirrored(part, own) for own, part in enumerate(velocity)])

    def _mirrored(self, component, own):
        for axis in self.folded:
            component = jnp.concatenate([_image(component, own, axis), component], axis)
        return component

    def symmetrised(
        self, velocity: Float[AnyArray, "axes ..."], parity: float
    ) -> Float[Array, "axes ..."]:
        """Return the part of a velocity with this parity under mirroring across the last axis.

        Parity 1 stands for a velocity that is its own mirror image, -1 for one that is minus its
        mirror image. The grid has no images of the last component's outermost faces, which stay.
        """
        axis = self.dimension - 1
        part = (velocity + parity * mirror_image(velocity, axis)) / 2
        return part.at[axis, ..., -1].set(velocity[axis, ..., -1])

    def rows(self, height: float) -> int:
        """Return the number of rows of cells in a tunnel of this height in D."""
        return round(height / self.step[1])

    def faces(self) -> tuple[tuple[np.ndarray, ...], ...]:
        """Return coordinates (x, y, ...) of the faces that carry u, of those that carry v, ..."""
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
        """Return the blending function w on the faces: 1 inside, 0 at the edge, over ``band`` D."""
        return self.profile(self.faces(), band)

    def profile(self, faces: tuple[tuple[np.ndarray, ...], ...], band: float) -> np.ndarray:
        """Return the blending function of this lattice on other faces, a product over the axes."""
        return np.stack(
            [
                functools.reduce(
                    np.multiply.outer, [self._edge(x, axis, band) for axis, x in enumerate(face)]
                )
                for face in faces
            ]
        )

    def _edge(self, coordinate, axis, band):
        """Return the blending function along one axis."""
        if axis > 0 and self.periodic:
            return np.ones_like(coordinate)
        low, high = self.grid.domain[axis]
        low = -high if axis > 0 else low
        margin = self.step[axis]
        distance = np.minimum(coordinate - low - margin, high - margin - coordinate)
        s = np.clip(distance / band, 0, 1)
        return s**3 * (10 - 15 * s + 6 * s**2)

    def variables(self, velocity: Float[AnyArray, "axes ..."]) -> tuple[grids.GridVariable, ...]:
        """Return the components of a face velocity as jax-cfd describes them, periodic."""
        bc = boundaries.periodic_boundary_conditions(self.dimension)
        return tuple(
            grids.GridVariable(grids.GridArray(component, offset, self.grid), bc)
            for component, offset in zip(velocity, self.grid.cell_faces, strict=True)
        )

    @functools.partial(jax.jit, static_argnums=0, inline=True)
    def convect(self, velocity: Float[AnyArray, "axes ..."]) -> Float[Array, "axes ..."]:
        """Return -div(u u) of a face velocity that vanishes at the edges, by jax-cfd.

        A folded grid and one from wall to wall may be treated as periodic as well: v = 0 at
        the top row stands for v = 0 on the centre line or the lower wall, and no flux of u
        crosses either.
        """
        terms = [term.data for term in advection.convect_linear(self.variables(velocity))]
        for axis in range(1, self.dimension):
            if axis in self.folded or self.periodic:
                terms[axis] = terms[axis].at[(slice(None),) * axis + (-1,)].set(0.0)
        return jnp.stack(terms)
