"""Traction modes in 3-D: spherical harmonics in mu = cos t and the azimuth."""

import dataclasses

import numpy as np
from jaxtyping import Float
from scipy.special import lpmv

from surrogate.arrays import AnyArray
from surrogate.body.skin import skin_grid

FORCE_UNIT = np.pi / 4  # frontal area of the sphere of D = 1, so that Cd = -2 a_0 as in 2-D


@dataclasses.dataclass(frozen=True)
class Modes3D:
    """Spherical harmonics of the traction of a body with the mirror planes y = 0 and z = 0.

    Group 0 is all that a body of revolution needs: P_k along the stream, P_k^1 outward from the
    axis. Group m, for flattened bodies, varies as cos 2m phi: P_k^2m along the stream, and
    P_k^(2m-1) and P_k^(2m+1) across it. ``flattened`` holds the highest degree of each group from 1
    on. The amplitude a_0 of mode 0 is the body's total force on the fluid along x in units of
    ``FORCE_UNIT``.
    """

    harmonics: int
    flattened: tuple[int, ...] = ()
    symmetric = True
    lift_index = None

    @property
    def count(self) -> int:
        """Number of modes."""
        return len(self._terms)

    @property
    def mirror(self) -> np.ndarray:
        """Factors of the amplitudes in the flow past the mirror image in y = 0: all 1."""
        return np.ones(self.count)

    def values(self, nodes: tuple[int, int]) -> Float[AnyArray, "modes 3 nodes"]:
        """Return the traction of every mode at the nodes, as force per unit mu and phi."""
        mu, phi = skin_grid(nodes)
        out = np.zeros((self.count, 3, mu.size))
        for row, (axial, sense, degree, order) in enumerate(self._terms):
            shape = lpmv(order, degree, mu) / _norm(degree, order)
            if axial:
                out[row, 0] = shape * np.cos(order * phi)
            else:
                out[row, 1] = shape * np.cos(order * phi)
                out[row, 2] = shape * sense * np.sin(order * phi)
        return out * FORCE_UNIT / (4 * np.pi)

    def weights(self, nodes: tuple[int, int]) -> Float[AnyArray, " nodes"]:
        """Return the quadrature weights of a quarter's nodes for integrals over mu and phi."""
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


def _norm(degree, order):
    """Return the root mean square of P_k^m over mu, with the sign that makes P_k^m positive."""
    factors = np.prod(np.arange(degree - order + 1, degree + order + 1, dtype=float))
    return np.sqrt(factors / (2 * degree + 1)) * (-1) ** order
