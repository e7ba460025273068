"""Traction modes in 3-D: spherical harmonics in mu = cos t and the azimuth."""

import dataclasses
import functools

import numpy as np
from jaxtyping import Float
from scipy.special import lpmv

from surrogate.arrays import AnyArray
from surrogate.body.skin import SkinNodes, skin_grid, skin_weights

FORCE_UNIT = np.pi / 4  # frontal area of the sphere of D = 1, so that Cd = -2 a_0 as in 2-D


@dataclasses.dataclass(frozen=True)
class Term:
    """One traction mode: P_degree^order(mu) times, along x, y and z, waves of order * phi.

    ``cosines`` and ``sines`` are the factors of cos(order phi) and sin(order phi) along each axis.
    """

    degree: int
    order: int
    cosines: tuple[int, int, int] = (0, 0, 0)
    sines: tuple[int, int, int] = (0, 0, 0)


@dataclasses.dataclass(frozen=True)
class Modes3D:
    """Spherical harmonics of the traction of a body with the mirror plane y = 0.

    The body and the stream may have the mirror plane z = 0 as well (``symmetric``). Then group 0
    is all that a body of revolution needs: P_k along the stream, P_k^1 outward from the axis.
    Group m, for flattened bodies, varies as cos 2m phi: P_k^2m along the stream, and P_k^(2m-1) and
    P_k^(2m+1) across it. ``flattened`` holds the highest degree of each group from 1 on. Without
    that mirror plane every component has all harmonics up to the degree ``harmonics`` and the order
    ``orders`` that y = 0 allows.

    The amplitude a_0 of mode 0 is the body's total force on the fluid along x, that of mode
    ``lift_index`` the total force along z, in units of ``FORCE_UNIT``.
    """

    harmonics: int
    flattened: tuple[int, ...] = ()
    symmetric: bool = True
    orders: int = 0

    @property
    def count(self) -> int:
        """The number of modes."""
        return len(self._terms)

    @property
    def lift_index(self) -> int | None:
        """The index of the mode whose amplitude is the force along z; None for symmetric bodies."""
        return None if self.symmetric else self._terms.index(Term(0, 0, cosines=(0, 0, 1)))

    @property
    def mirror(self) -> np.ndarray:
        """The factors, 1 or -1, of the amplitudes for the body's mirror image in z = 0."""
        images = np.array([1, 1, -1])  # of the components; phi turns into -phi
        return np.array([float(images @ (np.array(t.cosines) - t.sines)) for t in self._terms])

    def values(self, nodes: SkinNodes) -> Float[AnyArray, "modes 3 nodes"]:
        """Return the traction of every mode at the nodes, as force per unit mu and phi."""
        return _values(self, nodes)

    def weights(self, nodes: SkinNodes) -> Float[AnyArray, " nodes"]:
        """Return the quadrature weights of the nodes for integrals over mu and phi."""
        return skin_weights(nodes)

    @property
    def _terms(self) -> list[Term]:
        return self._symmetric_terms() if self.symmetric else self._all_terms()

    def _symmetric_terms(self):
        top = self.harmonics
        terms = [Term(k, 0, cosines=(1, 0, 0)) for k in range(top + 1)]
        terms += [_across(k, 1, 1) for k in range(1, top + 1)]
        for m, top in enumerate(self.flattened, 1):
            terms += [Term(k, 2 * m, cosines=(1, 0, 0)) for k in range(2 * m, top + 1)]
            terms += [_across(k, 2 * m - 1, -1) for k in range(2 * m - 1, top + 1)]
            terms += [_across(k, 2 * m + 1, 1) for k in range(2 * m + 1, top + 1)]
        return terms

    def _all_terms(self):
        """Return all terms: even in y along x and z, odd along y, cosines and sines by turns."""
        axes, terms = np.eye(3, dtype=int).tolist(), []
        for own in range(3):
            axis = tuple(axes[own])
            for order in range(self.orders + 1):
                cosine = (order % 2 == 0) != (own == 1)
                waves = {"cosines" if cosine else "sines": axis}
                degrees = range(order, self.harmonics + 1)
                if order > 0 or cosine:
                    terms += [Term(degree, order, **waves) for degree in degrees]
        return terms


@functools.lru_cache(maxsize=8)
def _values(modes, nodes):
    """Return the values of ``Modes3D.values``, which loads ask for again and again."""
    mu, phi = skin_grid(nodes)
    out = np.zeros((modes.count, 3, mu.size))
    for row, term in enumerate(modes._terms):
        shape = lpmv(term.order, term.degree, mu) / _norm(term.degree, term.order)
        waves = np.outer(term.cosines, np.cos(term.order * phi))
        out[row] = shape * (waves + np.outer(term.sines, np.sin(term.order * phi)))
    out *= FORCE_UNIT / (4 * np.pi)
    out.flags.writeable = False
    return out


def _across(degree, order, sense):
    """Return a mode across the stream that turns with phi (sense 1) or against it (-1)."""
    return Term(degree, order, cosines=(0, 1, 0), sines=(0, 0, sense))


def _norm(degree, order):
    """Return the root mean square of P_k^m over mu, with the sign that makes P_k^m positive."""
    factors = np.prod(np.arange(degree - order + 1, degree + order + 1, dtype=float))
    return np.sqrt(factors / (2 * degree + 1)) * (-1) ** order
