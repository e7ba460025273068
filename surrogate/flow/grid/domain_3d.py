"""The discrete problem in 3-D: a quarter of an unbounded stream, or half for bodies with lift."""

import dataclasses
import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.parameters import keep_mirror_plane
from surrogate.body.shape import Shape
from surrogate.body.skin import HALVES, QUARTERS, Skin, SkinNodes
from surrogate.flow.grid.domain import Domain, box_around, check_far_field
from surrogate.flow.grid.immersed import Wall
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes_3d import FORCE_UNIT, Modes3D
from surrogate.flow.grid.oseen_3d import SpaceKernel, space_kernel
from surrogate.flow.grid.wall_3d import wall_3d
from surrogate.scene.fidelity import Fidelity, check_cells
from surrogate.scene.scene import Scene
from surrogate.scene.stream import Stream

FAR_LEVELS = ((2.0, 24), (0.5, 96), (0.125, 384))  # cells per D, extent in D, as in 2-D
FLATTENED = (5,)  # highest degrees of the modes that vary around a flattened body
ORDERS = 3  # highest order of the modes of bodies at incidence
NUMBERS_AT_ONCE = 100_000  # in the velocities of modes that are computed at once
ROUNDING = 0.5  # D, to multiples of which the extent of a fitted body is rounded up
MARKER_SPACING = 0.8  # cells between markers, as in 2-D


@dataclasses.dataclass(frozen=True)
class Domain3D(Domain):
    """A 3-D discrete flow in an unbounded stream, past bodies with the mirror plane y = 0.

    Without incidence they have the mirror plane z = 0 too, and a quarter of the domain is gridded.
    """

    slip_compliance: float = 1e-8

    MIN_THICKNESS = 2.0
    CLEARANCE = (1.0, 0.5)
    FAR_PRECISION = jnp.float32  # changes forces by some 1e-8 of the drag (study ``precision``)
    FAR_COMBINATIONS = 6
    FORCE_UNIT = FORCE_UNIT

    @classmethod
    def of_scene(cls, scene: Scene) -> "Domain3D":
        """Discretise a scene on one grid that holds all of its bodies."""
        fidelity = scene.fidelity_for_bodies
        return cls.make(fidelity, scene.extent, cls.modes_of(scene.family.names, fidelity))

    @classmethod
    def around(
        cls,
        stream: Stream,
        fidelity: Fidelity,
        extent: np.ndarray,
        shape: Shape,
        reynolds: float,
    ) -> "Domain3D":
        """Discretise the unbounded stream around one body, in a box of multiples of 0.5 D."""
        names = ["flatness"] if shape.parameters.get("flatness", 1.0) != 1 else []
        names += [] if shape.symmetric else ["incidence"]
        modes = cls.modes_of(tuple(names), fidelity)
        extent = np.ceil(extent / ROUNDING) * ROUNDING
        return cls.make(fidelity, tuple(extent.tolist()), modes)

    @classmethod
    def modes_of(cls, names: tuple[str, ...], fidelity: Fidelity) -> Modes3D:
        """Return the spherical harmonics of the traction on family bodies with these parameters."""
        if not keep_mirror_plane(names):
            return Modes3D(fidelity.harmonics, symmetric=False, orders=ORDERS)
        return Modes3D(fidelity.harmonics, FLATTENED if "flatness" in names else ())

    @classmethod
    def make(
        cls, fidelity: Fidelity, extent: tuple[float, float, float], modes: Modes3D
    ) -> "Domain3D":
        """Discretise an unbounded stream around bodies that fit a box of ``extent`` D.

        Raises:
          InvalidInput: there are more cells than memory is likely to hold, or the domain is larger
            than the first lattice of the far field.
        """
        cells, folded = fidelity.cells, (1, 2) if modes.symmetric else (1,)

        def grid(before, after, across, per_d):
            rows = round(across * per_d / 2)
            shape = (round((before + after) * per_d), rows, rows if modes.symmetric else 2 * rows)
            return Lattice(shape, (1 / per_d,) * 3, round(before * per_d), folded=folded)

        lattice = grid(fidelity.upstream, fidelity.downstream, fidelity.height, cells)
        check_cells(fidelity, lattice.shape, modes.symmetric)
        far = tuple(grid(size // 3, size - size // 3, size, per_d) for per_d, size in FAR_LEVELS)
        check_far_field(lattice, far[0])
        along, across = (
            largest * math.pi * cells / MARKER_SPACING for largest in (max(extent), max(extent[1:]))
        )
        parts = QUARTERS if modes.symmetric else HALVES
        nodes = SkinNodes(math.ceil(along / 2), math.ceil(across / parts), parts)
        length, *sides = box_around(extent, cells)
        whole = lattice.unfolded.shape[1:]  # which holds the body, if not its rounded extent
        box = (length, *(min(pair) for pair in zip(sides, whole, strict=True)))
        return cls(lattice, far, modes, box, nodes, None)

    def green_function(
        self, lattice: Lattice, reynolds: Float[AnyArray, ""], dtype: DTypeLike = jnp.float64
    ) -> SpaceKernel:
        """Return the Green's function G of the discrete Oseen operator on a lattice."""
        return space_kernel(lattice, reynolds, dtype)

    def wall(self, markers: Skin, reynolds: Float[AnyArray, ""] | float) -> Wall:
        """Return the discretised wall of a body with this skin; see ``wall_3d``."""
        return wall_3d(self.lattice, self.modes, markers, reynolds)

    def each_mode(
        self, function: Callable[[Array], Array], amplitudes: Float[AnyArray, "rows modes"]
    ) -> Float[Array, "rows axes ..."]:
        """Apply a function to the rows of mode amplitudes, few at once, to save memory."""
        size = jax.eval_shape(function, amplitudes[0]).size  # all at once would take gigabytes
        at_once = NUMBERS_AT_ONCE // size
        return jax.lax.map(function, amplitudes, batch_size=at_once if at_once > 1 else None)
