"""Points and area vectors on the surface of a 3-D body, as the flow solver takes them."""

from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre

from surrogate.arrays import AnyArray

QUARTERS, HALVES = 4, 2  # parts of a body of which one is gridded


class SkinNodes(NamedTuple):
    """Numbers of nodes on the part of a body's surface that is gridded.

    Attributes:
      rings: at Gauss points of mu, from nose to tail.
      azimuths: phi of a ring, at the middles of equal steps.
      parts: of the whole skin; ``QUARTERS`` have y > 0 and z > 0, ``HALVES`` y > 0.
    """

    rings: int
    azimuths: int
    parts: int = QUARTERS


class Skin(eqx.Module):
    """Points of a quarter or half of the surface and their area vectors per unit mu and phi.

    The volume's centroid is the origin.
    """

    points: Float[AnyArray, "nodes 3"]
    areas: Float[AnyArray, "nodes 3"]
    nodes: SkinNodes = eqx.field(static=True)

    def __iter__(self):
        return iter((self.points, self.areas))


def skin_grid(
    nodes: SkinNodes,
) -> tuple[Float[np.ndarray, " nodes"], Float[np.ndarray, " nodes"]]:
    """Return mu and phi of every node of a ``Skin``, ring by ring."""
    mu = legendre.leggauss(nodes.rings)[0][::-1]
    first = 0.0 if nodes.parts == QUARTERS else -np.pi / 2
    phi = first + (np.arange(nodes.azimuths) + 0.5) * (2 * np.pi / nodes.parts / nodes.azimuths)
    along, around = np.meshgrid(mu, phi, indexing="ij")
    return along.ravel(), around.ravel()


def skin_weights(nodes: SkinNodes) -> Float[np.ndarray, " nodes"]:
    """Return the quadrature weights of a ``Skin``'s nodes for integrals over mu and phi."""
    along = legendre.leggauss(nodes.rings)[1]
    return np.repeat(along, nodes.azimuths) * (2 * np.pi / nodes.parts / nodes.azimuths)
