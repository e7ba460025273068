"""The discrete problem in 2-D: an unbounded stream, or a tunnel with slip walls."""

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
from surrogate.errors import InvalidInput
from surrogate.flow.grid.domain import SPLINE_CELLS, Domain, box_around, check_far_field
from surrogate.flow.grid.immersed import Wall
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes_2d import Modes2D
from surrogate.flow.grid.oseen_2d import Kernel, oseen_kernel
from surrogate.flow.grid.wall_2d import wall_2d
from surrogate.scene.fidelity import LIFTING_HARMONICS, Fidelity, check_cells
from surrogate.scene.scene import Scene
from surrogate.scene.stream import Stream, Tunnel, domain_height

FAR_LEVELS = ((2.0, 96), (0.25, 384))  # cells per D and extent in D of the far field's lattices
# Least Re of an unbounded far field by its extent; below, lattices 8 times as coarse and large are
# added. Convection is felt at distances of order 1 / Re: without them Cd of the cylinder is 0.8 %
# too high at Re 0.001 (study ``low_reynolds``).
FAR_REYNOLDS, FAR_STEP = 100.0, 8
WIDE = 3  # heights of a tunnel, beyond which its walls have ended the far field
# Orders of the far field's momentum flux in the body's force. The third takes 2 convolutions, and 7
# with lift, where it changes Cd half as much (study ``far_field``).
FAR_ORDER, LIFTING_FAR_ORDER = 3, 2
LEAST_EXTENT = (4.0, 2.0)  # D, of the box around a fitted body, each doubled as often as needed
MARKER_SPACING = 0.8  # cells between markers, so that the spread force has no gaps (Peskin 2002)


@dataclasses.dataclass(frozen=True)
class Domain2D(Domain):
    """A 2-D discrete flow; flows past bodies symmetric about y = 0 are solved on the upper half.

    Attributes:
      far_order: order of the far field's momentum flux in the body's force, 2 or 3.
    """

    slip_compliance: float = 1e-5
    far_order: int = LIFTING_FAR_ORDER

    MIN_THICKNESS = 2.5
    CLEARANCE = (1.5, 1.25)
    FAR_PRECISION = jnp.float64  # in single precision drags of equal flows differ by some 1e-8
    # A choice. Beyond, singular values on the edge of the box of known responses are below 3 % of
    # the largest, and flows take as many Krylov vectors as with all modes.
    FAR_COMBINATIONS = 8
    FORCE_UNIT = 1.0

    @classmethod
    def of_scene(cls, scene: Scene) -> "Domain2D":
        """Discretise a scene on one grid that holds all of its bodies."""
        symmetric = scene.family.body_class.symmetric
        at = scene.fidelity_for_bodies, scene.extent, symmetric
        return cls.make(scene.stream, *at, reynolds=scene.reynolds[0])

    @classmethod
    def around(
        cls,
        stream: Stream,
        fidelity: Fidelity,
        extent: np.ndarray,
        shape: Shape,
        reynolds: float,
    ) -> "Domain2D":
        """Discretise a stream around one body, in a box of 4, 8... by 2, 4... D that holds it."""
        doublings = np.ceil(np.maximum(np.log2(extent / LEAST_EXTENT), 0.0))
        room = tuple((LEAST_EXTENT * 2**doublings).tolist())
        at = tuple(extent.tolist()), shape.symmetric
        return cls.make(stream, fidelity, *at, box_extent=room, reynolds=reynolds)

    @classmethod
    def modes_of(cls, names: tuple[str, ...], fidelity: Fidelity) -> Modes2D:
        """Return the Fourier modes of the traction on family bodies with these parameters."""
        return _modes(fidelity, symmetric=keep_mirror_plane(names))

    @classmethod
    def make(
        cls,
        stream: Stream,
        fidelity: Fidelity,
        extent: tuple[float, float],
        symmetric: bool,
        *,
        box_extent: tuple[float, float] | None = None,
        reynolds: float = 1.0,
    ) -> "Domain2D":
        """Discretise a stream around bodies of at most ``extent`` (length, height) in D.

        Args:
          stream: unbounded or a tunnel.
          fidelity: cells per D, harmonics and size of the domain.
          extent: of the bodies in D, and of the box in which their forces are spread.
          symmetric: whether the bodies are symmetric about y = 0, so that half is solved.
          box_extent: a larger extent for the box, as far as the lattice goes.
          reynolds: least U D / nu, for which the far field of an unbounded stream is large enough.

        Raises:
          InvalidInput: the box does not fit between the tunnel's walls, or the grid has more cells
            than memory is likely to hold, or is larger than the first lattice of the far field.
        """
        cells, height = fidelity.cells, stream.height if isinstance(stream, Tunnel) else None
        width = domain_height(stream, fidelity.height)

        def grid(before, after, across, per_d):
            step = 1 / per_d
            if height is not None:  # a whole, even number of rows from wall to wall
                step = height / (2 * round(height * per_d / 2))
            rows = 2 * round(across / step / 2)
            return Lattice(
                (round((before + after) * per_d), rows // 2 if symmetric else rows),
                (1 / per_d, step),
                round(before * per_d),
                periodic=across == height,
                folded=(1,) if symmetric else (),
            )

        lattice = grid(fidelity.upstream, fidelity.downstream, width, cells)
        check_cells(fidelity, lattice.shape, symmetric)
        far = tuple(
            grid(size // 3, size - size // 3, min(size, height or size), per_d)
            for per_d, size in _far_levels(height, reynolds)
        )
        check_far_field(lattice, far[0])
        box = box_around(extent, cells)
        if box[1] > lattice.unfolded.shape[1]:
            needed = math.ceil((2 * SPLINE_CELLS + 2) / (width - extent[1]))
            raise InvalidInput(
                f"{stream}: {lattice.unfolded.shape[1]} rows of cells from wall to wall, and a "
                f"body {extent[1]:g} D high needs {box[1]}; {needed} cells per D would do"
            )
        if box_extent is not None:
            held = 2 * min(lattice.inlet, lattice.shape[0] - lattice.inlet)
            sides = zip(
                box_around(box_extent, cells), (held, lattice.unfolded.shape[1]), strict=True
            )
            box, extent = tuple(min(side) for side in sides), box_extent
        nodes = 2 * math.ceil(max(extent) * math.pi * cells / MARKER_SPACING)
        order = FAR_ORDER if symmetric else LIFTING_FAR_ORDER
        modes = _modes(fidelity, symmetric)
        return cls(lattice, far, modes, box, nodes, height, far_order=order)

    @property
    def operators_are_small(self) -> bool:
        """Whether the operators of all samples can be stored: true for symmetric bodies."""
        return self.modes.symmetric

    @property
    def least_reynolds(self) -> float:
        """The least U D / nu for which the far field's lattices are large enough."""
        largest = self.far[-1]
        extent = largest.shape[0] * largest.step[0]
        return FAR_REYNOLDS / extent if self.height is None else 0.0

    def green_function(
        self, lattice: Lattice, reynolds: Float[AnyArray, ""], dtype: DTypeLike = jnp.float64
    ) -> Kernel:
        """Return the Green's function G of the discrete Oseen operator on a lattice."""
        return oseen_kernel(lattice, reynolds, self.height, dtype)

    def wall(
        self, markers: Float[AnyArray, "nodes 2"], reynolds: Float[AnyArray, ""] | float
    ) -> Wall:
        """Return the discretised wall of a body with this contour; see ``wall_2d``."""
        return wall_2d(self.lattice, self.modes, markers, reynolds)

    def each_mode(
        self, function: Callable[[Array], Array], amplitudes: Float[AnyArray, "rows modes"]
    ) -> Float[Array, "rows axes ..."]:
        """Apply a function to all rows of mode amplitudes at once."""
        return jax.vmap(function)(amplitudes)


def _far_levels(height, reynolds):
    """Return cells per D and extents in D of the far field's lattices, for Re from ``reynolds``."""
    if height is not None and height <= FAR_LEVELS[0][1]:
        return FAR_LEVELS[:1]
    levels, enough = list(FAR_LEVELS), WIDE * height if height is not None else math.inf
    while levels[-1][1] < min(enough, FAR_REYNOLDS / reynolds):
        cells, extent = levels[-1]
        levels.append((cells / FAR_STEP, FAR_STEP * extent))
    return tuple(levels)


def _modes(fidelity, symmetric):
    """Return the traction modes; those of lifting bodies have higher harmonics."""
    more = 1.0 if symmetric else LIFTING_HARMONICS
    return Modes2D(math.ceil(more * fidelity.harmonics), symmetric)
