"""The discrete problem as one static object, which 2-D and 3-D implement."""

import abc
import dataclasses
import math
from collections.abc import Callable
from typing import ClassVar, Protocol, runtime_checkable

import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Float, Int

from surrogate.arrays import AnyArray
from surrogate.body.shape import Shape
from surrogate.body.skin import SkinNodes
from surrogate.errors import InvalidInput
from surrogate.flow.grid.immersed import Markers, Spreading, Wall, spread_modes
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes_2d import Modes2D
from surrogate.flow.grid.modes_3d import Modes3D
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.limits import ROUNDING
from surrogate.scene.scene import Scene
from surrogate.scene.stream import Stream

NEAR_MARGIN = 0.25  # D, from the box of forces to the edge of the box of known responses
SPLINE_CELLS = 3  # of the box beyond the body: half a spline's support, and a margin


@runtime_checkable
class GreenFunction(Protocol):
    """The Green's function G of the discrete Oseen operator on a lattice."""

    def __call__(self, force: Float[AnyArray, "axes ..."]) -> Float[AnyArray, "axes ..."]:
        """Return the velocity on faces due to a force density on faces: one convolution with G."""

    def of_parity(
        self, force: Float[AnyArray, "axes ..."], odd: Int[AnyArray, ""]
    ) -> Float[AnyArray, "axes ..."]:
        """Return the velocity due to a force that is its own mirror image, or minus it (``odd`` 1).

        The mirror plane is the middle of the last axis, which is not folded.
        """

    @property
    def transposed(self) -> "GreenFunction":
        """The transpose of G, that of the reversed stream; JAX's own takes about twice as long."""


@dataclasses.dataclass(frozen=True)
class Domain(abc.ABC):
    """A discrete flow problem without its arrays: hashable, so a static argument of jit.

    Attributes:
      lattice: the computational domain's grid.
      far: coarser, larger grids on which the far field's momentum flux is computed.
      modes: the traction modes of a body.
      box: cells along each axis of the box around the body in which forces are spread.
      nodes: number of surface markers of a body.
      height: distance of the tunnel's walls in D; None for an unbounded stream.
      slip_compliance: compliance that is added for every traction mode, for conditioning, from
        Re 1 on; see ``conditioned``.
    """

    lattice: Lattice
    far: tuple[Lattice, ...]
    modes: Modes2D | Modes3D
    box: tuple[int, ...]
    nodes: int | SkinNodes
    height: float | None
    slip_compliance: float

    MIN_THICKNESS: ClassVar[float]  # cells across the mean thickness of a body
    CLEARANCE: ClassVar[tuple[float, float]]  # D from a fitted body to the domain's edges
    FAR_PRECISION: ClassVar[DTypeLike]  # of the coarse lattices of the far field
    FAR_COMBINATIONS: ClassVar[int]  # of the modes of lifting bodies, see ``CompressedResponse``
    FORCE_UNIT: ClassVar[float]  # force, over rho U^2 D^(d-1), of a unit amplitude of mode 0

    @classmethod
    @abc.abstractmethod
    def of_scene(cls, scene: Scene) -> "Domain":
        """Discretise a scene on one grid that holds all of its bodies."""

    @classmethod
    @abc.abstractmethod
    def around(
        cls,
        stream: Stream,
        fidelity: Fidelity,
        extent: np.ndarray,
        shape: Shape,
        reynolds: float,
    ) -> "Domain":
        """Discretise a stream around one body, in one of few boxes that hold it.

        Args:
          stream: unbounded or a tunnel.
          fidelity: cells per D, harmonics and size of the domain.
          extent: of the body along each axis, in D.
          shape: the body.
          reynolds: U D / nu.
        """

    @classmethod
    @abc.abstractmethod
    def modes_of(cls, names: tuple[str, ...], fidelity: Fidelity) -> Modes2D | Modes3D:
        """Return the traction modes of family bodies with these parameters."""

    @abc.abstractmethod
    def green_function(
        self, lattice: Lattice, reynolds: Float[AnyArray, ""], dtype: DTypeLike = jnp.float64
    ) -> GreenFunction:
        """Return the Green's function G of the discrete Oseen operator on a lattice.

        Args:
          lattice: the grid.
          reynolds: U D / nu.
          dtype: of the velocities that G returns for forces of the same dtype.
        """

    @abc.abstractmethod
    def wall(self, markers: Markers, reynolds: Float[AnyArray, ""] | float) -> Wall:
        """Return the discretised wall of a body: the traction of every mode, and the slip law.

        Args:
          markers: of the body.
          reynolds: U D / nu.
        """

    @abc.abstractmethod
    def each_mode(
        self, function: Callable[[Array], Array], amplitudes: Float[AnyArray, "rows modes"]
    ) -> Float[Array, "rows axes ..."]:
        """Apply a function to every row of mode amplitudes."""

    @property
    def half_extent(self) -> Float[np.ndarray, " axes"]:
        """The largest |x|, |y|, ... in D of a body that the box can hold."""
        return (np.array(self.box) / 2 - (SPLINE_CELLS - 1)) * self.lattice.step

    def spread_body(self, markers: Markers, reynolds: Float[AnyArray, ""] | float) -> Spreading:
        """Spread all traction modes from a body's surface to the grid."""
        wall = self.conditioned(self.wall(markers, reynolds), reynolds)
        return spread_modes(self.lattice, self.box, wall)

    def conditioned(self, wall: Wall, reynolds: Float[AnyArray, ""] | float) -> Wall:
        """Return a wall with a slight compliance of every traction mode, for conditioning.

        Velocities fall as Re below Re 1 where forces are given, over rho U^2 D, and so does it: the
        share of the drag that it takes stays the same.
        """
        low = jnp.minimum(reynolds, 1.0)
        slight = self.slip_compliance * low * (2 - low)  # smooth at Re 1
        return wall._replace(compliance=wall.compliance + slight * jnp.eye(len(wall.values)))

    @property
    def operators_are_small(self) -> bool:
        """Whether the operators of all samples of a training can be stored.

        Otherwise those of one body take tens of megabytes.
        """
        return False

    @property
    def least_reynolds(self) -> float:
        """The least U D / nu for which the far field's lattices are large enough."""
        return 0.0

    @property
    def far_order(self) -> int:
        """The order of the far field's momentum flux in the body's force."""
        return 2

    @property
    def far_combinations(self) -> int | None:
        """The number of combinations of modes in the response far away.

        None, for all modes, if the bodies have no lift.
        """
        return None if self.modes.symmetric else self.FAR_COMBINATIONS

    @property
    def near(self) -> tuple[tuple[int, ...], Lattice]:
        """The first cell, and the lattice, of a box in which every mode's response is known."""
        cells = [round(NEAR_MARGIN / step) for step in self.lattice.step]
        whole = self.lattice.unfolded.shape
        sides = [
            min(side + 2 * margin, limit)
            for side, margin, limit in zip(self.box, cells, whole, strict=True)
        ]
        inlet = min(sides[0] // 2, self.lattice.inlet)
        corner, shape = [self.lattice.inlet - inlet], [sides[0]]
        for axis in range(1, len(sides)):
            folded = axis in self.lattice.folded
            corner.append(0 if folded else (self.lattice.shape[axis] - sides[axis]) // 2)
            shape.append(sides[axis] // 2 if folded else sides[axis])
        lattice = dataclasses.replace(self.lattice, shape=tuple(shape), inlet=inlet, periodic=False)
        return tuple(corner), lattice

    @property
    def assembly_cost(self) -> int:
        """The number of convolutions with G that assembling a body's operators takes.

        One a mode or combination of modes, those of all modes near the body by their share of the
        lattice, and those of the far field, whose coarse grids are counted as one each: a unit
        force and a source per grid, for drag alone; two forces and three sources with lift. The
        third order takes one for every second-order velocity and for every source, on one grid.
        """
        forces = 1 if self.modes.symmetric else 2
        quadratic, cubic = math.comb(forces + 1, 2), math.comb(forces + 2, 3)
        far = len(self.far) * (forces + quadratic)
        far += quadratic + cubic if self.far_order > 2 else 0
        if self.far_combinations is None:
            return self.modes.count + far
        share = math.prod(self.near[1].shape) / math.prod(self.lattice.shape)
        return self.far_combinations + math.ceil(self.modes.count * share) + far

    def forces(self, amplitude: Float[AnyArray, " modes"]) -> Float[Array, " 2"]:
        """Return the total force of the body on the fluid, drag and lift, in ``FORCE_UNIT``."""
        lift = 0.0 if self.modes.lift_index is None else amplitude[self.modes.lift_index]
        return jnp.stack([amplitude[0], lift])


def too_thin(cells: float, needed: float, step: float) -> str:
    """Return the message for a body whose mean thickness has too few cells of size ``step``."""
    return (
        f"body: its mean thickness is {math.floor(100 * cells) / 100:g} cells and at least "
        f"{needed:g} are needed; {math.ceil(needed / cells / step)} cells per D would resolve it"
    )


def check_far_field(lattice: Lattice, nearest: Lattice) -> None:
    """Raise InvalidInput unless a domain lies within the first lattice of its far field.

    Beyond, the far field would be extrapolated.

    Args:
      lattice: of the domain.
      nearest: the first lattice of the far field.
    """
    own, most = map(_sides, (lattice, nearest))
    if any(side > limit * (1 + ROUNDING) for side, limit in zip(own, most, strict=True)):
        words = "{:g} D upstream, {:g} D downstream and {:g} D across"
        raise InvalidInput(
            f"fidelity: a domain of {words.format(*own)}; at most {words.format(*most)}"
        )


def _sides(lattice):
    """Return how far a lattice reaches upstream and downstream, and its side across, in D."""
    step, (columns, *_, rows) = lattice.step, lattice.unfolded.shape
    return lattice.inlet * step[0], (columns - lattice.inlet) * step[0], rows * step[-1]


def box_around(extent: tuple[float, ...], cells: int) -> tuple[int, ...]:
    """Return the number of cells, along each axis, of a box around a body of ``extent`` D.

    The box holds the splines' support too; ``cells`` are per D.
    """
    return tuple(2 * math.ceil(side / 2 * cells + SPLINE_CELLS) for side in extent)
