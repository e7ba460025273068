"""The discrete problem of a scene: lattices, traction modes and the body's box. All static."""

import dataclasses
import math

from surrogate.flow.immersed import Modes
from surrogate.flow.lattice import Lattice
from surrogate.scene import Fidelity, Stream, Tunnel

FAR_CELLS = (2.0, 0.25)  # cells per D of the far field's nested lattices
FAR_SIZES = (96, 384)  # their extents in D


@dataclasses.dataclass(frozen=True)
class Domain:
    """Everything about a discrete flow that is not an array; hashable, so a static argument."""

    lattice: Lattice
    far: tuple[Lattice, ...]
    modes: Modes
    box: tuple[int, int]
    nodes: int
    height: float | None
    slip_compliance: float = 1e-5

    @property
    def mirrored(self) -> bool:
        return self.height is not None and not self.modes.symmetric


def make_domain(
    stream: Stream, fidelity: Fidelity, extent: tuple[float, float], symmetric: bool
) -> Domain:
    """Discretise a stream around bodies that fit a box of ``extent`` (length, height) in D."""
    n, upstream, downstream = fidelity.cells, fidelity.upstream, fidelity.downstream
    height = stream.height if isinstance(stream, Tunnel) else None
    # a tunnel's confined wake is gridded from wall to wall where that is affordable
    spans = height is not None and height <= 2 * fidelity.height
    width = height if spans else fidelity.height
    # with slip walls and a body off the centre line the period is 2 H: the walls stay cut off
    repeats = symmetric and height is not None

    def window(before, after, across, cells):
        step = 1 / cells
        if height is not None:  # a whole, even number of rows from wall to wall
            step = height / (2 * round(height * cells / 2))
        rows = 2 * round(across / step / 2)
        return Lattice(
            (round((before + after) * cells), rows // 2 if symmetric else rows),
            (1 / cells, step),
            round(before * cells),
            periodic=repeats and across == height,
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
