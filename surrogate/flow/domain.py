"""The discrete problem of a scene: lattices, traction modes and the body's box. All static."""

import dataclasses
import math

from surrogate.flow.immersed import Modes
from surrogate.flow.lattice import Lattice
from surrogate.scene import Fidelity, Stream, Tunnel, Unbounded

COARSE_CELLS = 2  # cells per D of the far field's lattice
COARSE_SIZE = 96  # its extent in D


@dataclasses.dataclass(frozen=True)
class Domain:
    """Everything about a discrete flow that is not an array; hashable, so a static argument."""

    lattice: Lattice
    coarse: Lattice
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
    n = fidelity.cells
    upstream, downstream, width = fidelity.upstream, fidelity.downstream, fidelity.height
    match stream:
        case Unbounded():
            height, far_rows = None, COARSE_SIZE * COARSE_CELLS
        case Tunnel(height):
            width = min(width, height)
            far_rows = min(COARSE_SIZE, int(height)) * COARSE_CELLS
    lattice = Lattice((round((upstream + downstream) * n), round(width * n)), (1 / n, 1 / n), round(upstream * n))
    columns = COARSE_SIZE * COARSE_CELLS
    step = 1 / COARSE_CELLS
    coarse = Lattice((columns, far_rows), (step, step), columns // 3)
    box = tuple(2 * math.ceil((side / 2) * n + 3) for side in extent)
    nodes = 2 * math.ceil(max(extent) * math.pi * n / 0.8)
    return Domain(lattice, coarse, Modes(fidelity.harmonics, symmetric), box, nodes, height)
