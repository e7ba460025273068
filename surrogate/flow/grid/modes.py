"""Traction modes: the few numbers by which a body's traction is known, in the plane and in space.

Mode 0 is the total force along the stream, in units that make Cd = -2 a_0 in both: the force per
span in the plane, over pi / 4 (a sphere's frontal area) in space.
"""

import dataclasses

import numpy as np
from jaxtyping import Float
from scipy.special import lpmv

from surrogate.arrays import AnyArray
from surrogate.body.skin import skin_grid

SPACE_UNIT = np.pi / 4  # force of a unit amplitude in space


@dataclasses.dataclass(frozen=True)
class Modes:
    """Fourier modes of the traction in the contour parameter t.

    Symmetric bodies: cosines for x (harmonics 0...K) and sines for y (1...K). Others: all of
    both. Mode 0 is the total x force; ``lift_index`` is the total y force.
    """

    harmonics: int
    symmetric: bool

    @property
    def count(self) -> int:
        return (2 if self.symmetric else 4) * self.harmonics + (1 if self.symmetric else 2)

    @property
    def lift_index(self) -> int | None:
        return None if self.symmetric else 2 * self.harmonics + 1

    def values(self, nodes: int) -> Float[AnyArray, "modes 2 nodes"]:
        """Traction vector of every mode at ``nodes`` equidistant t: force per unit t."""
        t = 2 * np.pi * np.arange(nodes) / nodes
        j = np.arange(1, self.harmonics + 1)[:, None]
        constant, cosine, sine = np.ones((1, nodes)), np.cos(j * t), np.sin(j * t)
        x = [constant, cosine] if self.symmetric else [constant, cosine, sine]
        y = [sine] if self.symmetric else [constant, cosine, sine]
        x, y = np.concatenate(x), np.concatenate(y)
        out = np.zeros((self.count, 2, nodes))
        out[: len(x), 0], out[len(x) :, 1] = x, y
        return out / (2 * np.pi)

    def weights(self, nodes: int) -> Float[AnyArray, " nodes"]:
        """Of the nodes in an integral over t."""
        return np.full(nodes, 2 * np.pi / nodes)


@dataclasses.dataclass(frozen=True)
class SpaceModes:
    """Spherical harmonics of the traction in mu = cos t and the azimuth phi, two mirror planes.

    Group 0 is all that a body of revolution needs: P_k along the stream, P_k^1 outward. Group m,
    of bodies that are flattened, varies as cos 2m phi: P_k^2m along the stream and two ways
    across, P_k^(2m-1) and P_k^(2m+1), up to ``flattened`` degrees.
    """

    harmonics: int
    flattened: tuple[int, ...] = ()
    symmetric = True
    lift_index = None

    @property
    def count(self) -> int:
        return len(self._terms)

    def values(self, nodes: tuple[int, int]) -> Float[AnyArray, "modes 3 nodes"]:
        """Traction vector of every mode at the nodes: force per unit mu and phi."""
        mu, phi = skin_grid(nodes)
        out = np.zeros((self.count, 3, mu.size))
        for row, (axial, sense, degree, order) in enumerate(self._terms):
            shape = lpmv(order, degree, mu) / _size(degree, order)
            if axial:
                out[row, 0] = shape * np.cos(order * phi)
            else:
                out[row, 1] = shape * np.cos(order * phi)
                out[row, 2] = shape * sense * np.sin(order * phi)
        return out * SPACE_UNIT / (4 * np.pi)

    def weights(self, nodes: tuple[int, int]) -> Float[AnyArray, " nodes"]:
        """Of the nodes of a quarter in an integral over mu and phi."""
        along = np.polynomial.legendre.leggauss(nodes[0])[1]
        return np.repeat(along, nodes[1]) * (np.pi / 2 / nodes[1])

    @property
    def _terms(self):
        """(along the stream or across, sense of rotation across, degree, order) of every mode."""
        top = self.harmonics
        terms = [(True, 0, k, 0) for k in range(top + 1)]
        terms += [(False, 1, k, 1) for k in range(1, top + 1)]
        for m, top in enumerate(self.flattened, 1):
            terms += [(True, 0, k, 2 * m) for k in range(2 * m, top + 1)]
            terms += [(False, -1, k, 2 * m - 1) for k in range(2 * m - 1, top + 1)]
            terms += [(False, 1, k, 2 * m + 1) for k in range(2 * m + 1, top + 1)]
        return terms


def _size(degree, order):
    """Root of the mean square over mu of P_k^m; times that of cos m phi along the stream."""
    factors = np.prod(np.arange(degree - order + 1, degree + order + 1, dtype=float))
    return np.sqrt(factors / (2 * degree + 1)) * (-1) ** order
