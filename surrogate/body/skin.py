"""Points and area vectors on the surface of a 3-D body, as the flow solver takes them."""

import equinox as eqx
import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre

from surrogate.arrays import AnyArray

QUARTERS = 4  # of a body, of which one is gridded


class Skin(eqx.Module):
    """Points of a quarter of the surface (y, z > 0) and their area vectors per unit mu and phi.

    ``nodes`` are the numbers of rings, at Gauss points of mu from nose to tail, and of azimuths
    phi, at the middles of equal steps of a quarter turn. The volume's centroid is the origin.
    """

    points: Float[AnyArray, "nodes 3"]
    areas: Float[AnyArray, "nodes 3"]
    nodes: tuple[int, int] = eqx.field(static=True)

    def __iter__(self):
        return iter((self.points, self.areas))


def skin_grid(
    nodes: tuple[int, int],
) -> tuple[Float[np.ndarray, " nodes"], Float[np.ndarray, " nodes"]]:
    """Return mu and phi of every node of a ``Skin``, ring by ring."""
    mu = legendre.leggauss(nodes[0])[0][::-1]
    phi = (np.arange(nodes[1]) + 0.5) * (np.pi / 2 / nodes[1])
    along, around = np.meshgrid(mu, phi, indexing="ij")
    return along.ravel(), around.ravel()
