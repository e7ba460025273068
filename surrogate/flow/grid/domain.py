"""The discrete problem of a scene: lattices, traction modes and the body's box. All static."""

import dataclasses
import math

import numpy as np
from jaxtyping import Float

from surrogate.body.family import Family
from surrogate.body.measures import mean_thickness
from surrogate.body.shape import Shape
from surrogate.errors import InvalidInput
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes import Modes, SpaceModes
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.limits import check_stream
from surrogate.scene.scene import Scene
from surrogate.scene.stream import Stream, Tunnel, window_height

FAR_CELLS = (2.0, 0.25)  # cells per D of the far field's nested lattices
FAR_SIZES = (96, 384)  # their extents in D
SPACE_FAR = ((2.0, 24), (0.5, 96), (0.125, 384))  # the same in space: cells per D, extents
MOST_IN_SPACE = 4_000_000  # cells of a quarter window
FLATTENED = (5,)  # degrees of the traction modes that vary around a flattened body
THINNEST = {2: 2.5, 3: 2.0}  # cells across the mean thickness, in the plane and in space
NODES_TO_FIT = 400
ROOM = {2: (1.5, 1.25), 3: (1.0, 0.5)}  # D that a fitted body leaves along and across


@dataclasses.dataclass(frozen=True)
class Domain:
    """Everything about a discrete flow that is not an array; hashable, so a static argument."""

    lattice: Lattice
    far: tuple[Lattice, ...]
    modes: Modes | SpaceModes
    box: tuple[int, ...]
    nodes: int | tuple[int, int]
    height: float | None
    slip_compliance: float = 1e-5

    @property
    def mirrored(self) -> bool:
        return self.height is not None and not self.modes.symmetric

    @property
    def reach(self) -> Float[np.ndarray, " axes"]:
        """Largest |x|, |y|, ... in D of a body that its box holds."""
        return (np.array(self.box) / 2 - 2) * self.lattice.step


def traction_modes(family: Family, fidelity: Fidelity) -> Modes | SpaceModes:
    """The modes of the symmetric bodies of a family: only as many as they need."""
    if family.dimension == 2:
        return Modes(fidelity.harmonics, symmetric=True)
    return SpaceModes(fidelity.harmonics, FLATTENED if "flatness" in family.names else ())


def space_domain(
    fidelity: Fidelity, extent: tuple[float, float, float], modes: SpaceModes
) -> Domain:
    """Discretise an unbounded stream around bodies that fit a box of ``extent`` in D.

    Raises:
      InvalidInput: the window has more cells than memory is likely to hold.
    """

    def window(before, after, across, cells):
        rows = round(across * cells / 2)
        shape = (round((before + after) * cells), rows, rows)
        return Lattice(shape, (1 / cells,) * 3, round(before * cells), symmetric=True)

    n = fidelity.cells
    lattice = window(fidelity.upstream, fidelity.downstream, fidelity.height, n)
    if (count := math.prod(lattice.shape)) > MOST_IN_SPACE:
        raise InvalidInput(
            f"fidelity {fidelity.name}: a quarter window of {count / 1e6:.1f} million cells; in "
            f"space up to {MOST_IN_SPACE / 1e6:g} are solved, fewer per D would do"
        )
    far = tuple(window(size // 3, size - size // 3, size, cells) for cells, size in SPACE_FAR)
    box = tuple(2 * math.ceil((side / 2) * n + 3) for side in extent)
    around, across = max(extent) * math.pi * n / 0.8, max(extent[1:]) * math.pi * n / 0.8
    nodes = math.ceil(around / 2), math.ceil(across / 4)
    return Domain(lattice, far, modes, box, nodes, None, slip_compliance=1e-8)


def make_domain(
    stream: Stream, fidelity: Fidelity, extent: tuple[float, float], symmetric: bool
) -> Domain:
    """Discretise a stream around bodies that fit a box of ``extent`` (length, height) in D."""
    n, upstream, downstream = fidelity.cells, fidelity.upstream, fidelity.downstream
    height = stream.height if isinstance(stream, Tunnel) else None
    width = window_height(stream, fidelity.height)

    def window(before, after, across, cells):
        step = 1 / cells
        if height is not None:  # a whole, even number of rows from wall to wall
            step = height / (2 * round(height * cells / 2))
        rows = 2 * round(across / step / 2)
        return Lattice(
            (round((before + after) * cells), rows // 2 if symmetric else rows),
            (1 / cells, step),
            round(before * cells),
            periodic=across == height,
            symmetric=symmetric,
        )

    lattice = window(upstream, downstream, width, n)
    levels = FAR_CELLS if height is None or height > FAR_SIZES[0] else FAR_CELLS[:1]
    far = tuple(
        window(size // 3, size - size // 3, size if height is None else min(size, height), cells)
        for cells, size in zip(levels, FAR_SIZES, strict=False)
    )
    box = tuple(2 * math.ceil((side / 2) * n + 3) for side in extent)
    nodes = 2 * math.ceil(max(extent) * math.pi * n / 0.8)
    return Domain(lattice, far, Modes(fidelity.harmonics, symmetric), box, nodes, height)


def scene_domain(scene: Scene) -> Domain:
    """The domain that holds every body of a scene, and the cylinder, at every Re of it.

    Raises:
      InvalidInput: its longest or tallest bodies do not fit window or tunnel.
    """
    extent, fidelity = scene.extent, scene.reaching
    check_stream(scene.stream, fidelity, np.array(extent), room=(1.0, 0.5))
    if scene.dimension == 3:
        return space_domain(fidelity, extent, traction_modes(scene.family, fidelity))
    return make_domain(scene.stream, fidelity, extent, symmetric=True)


def fitted_domain(stream: Stream, fidelity: Fidelity, shape: Shape, reynolds: float) -> Domain:
    """Domain for one body, its box rounded up so that similar bodies share compiled code.

    The window is as long as the wake at this Re asks for.

    Raises:
      InvalidInput: the body is thinner than the grid resolves, or does not fit the stream.
    """
    reach = shape.reach
    thinner = np.array([1.0, reach[1:].min() / reach[-1]])  # of a body that is higher than wide
    thickness = mean_thickness(thinner * shape.draw(NODES_TO_FIT)) * fidelity.cells
    thinnest = THINNEST[shape.dimension]
    if thickness < thinnest:
        needed = math.ceil(fidelity.cells * thinnest / thickness)
        raise InvalidInput(
            f"body: its mean thickness is {math.floor(100 * thickness) / 100:g} cells and at least "
            f"{thinnest:g} are "
            f"needed; {needed} cells per D would resolve it"
        )
    fidelity = fidelity.reaching(reynolds, float(reach[1:].max()))
    reach = np.ceil(reach * 4) / 4
    room = ROOM[shape.dimension]
    check_stream(stream, fidelity, reach, room)
    if shape.dimension == 3:
        flattened = FLATTENED if shape.parameters.get("flatness", 1.0) != 1 else ()
        return space_domain(
            fidelity, tuple(reach.tolist()), SpaceModes(fidelity.harmonics, flattened)
        )
    return make_domain(stream, fidelity, tuple(reach.tolist()), shape.symmetric)
