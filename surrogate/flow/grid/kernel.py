"""The Green's function of a lattice, whatever its dimension."""

from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.oseen import Kernel, SymmetricKernel, oseen_kernel
from surrogate.flow.grid.oseen_3d import SpaceKernel, space_kernel

AnyKernel = Kernel | SymmetricKernel | SpaceKernel


def make_kernel(
    lattice: Lattice, reynolds: Float[AnyArray, ""], height: float | None, mirrored: bool = False
) -> AnyKernel:
    """As ``oseen_kernel``; in space, where there are no walls, as ``space_kernel``."""
    if lattice.dimension == 3:
        return space_kernel(lattice, reynolds)
    return oseen_kernel(lattice, reynolds, height, mirrored)
