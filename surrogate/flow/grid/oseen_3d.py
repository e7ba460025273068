"""Green's function of the discrete Oseen operator in 3-D, unbounded along and across the stream.

The lattice operator is that of 2-D, with equal steps. Its kernel follows from two scalars, g =
sigma^-1 and Q = Lap^-1 sigma^-1: with beta = beta_y + beta_z

    xx = -(beta / h^2) Q,  yy = g + (beta_y / h^2) Q,  zz = g + (beta_z / h^2) Q,  ij = -D+i D-j Q.

Across the stream g and Q depend on beta alone. As sums of exp(-t beta), fitted column by column,
they need no integrals over wave numbers: the exponentials factor into the two directions, and
each is the heat kernel of a one-dimensional lattice, exp(-2t) I_n(2t) at distance n.
"""

import functools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from scipy.fft import next_fast_len
from scipy.special import ive

from surrogate.arrays import AnyArray
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.oseen_2d import sequences

# Times t of the exponentials and points beta of their fit, from the far field of the largest
# lattice to the shortest waves: G to 1e-10 of its largest value (study ``constants``).
TIMES = np.append(0.0, np.exp(np.arange(-5.0, 31.0, 0.3)))
BETAS = np.exp(np.linspace(-32.0, np.log(8.0), 1000))
SINGULAR_CUT = 1e-13  # relative, below which singular values of the fit are dropped
LARGEST_X = 1e8  # argument of a Bessel function, beyond which its expansion is exact


class SpaceKernel(eqx.Module):
    """Spectra of g and Q on a quarter of the domain (y > 0, z > 0), in wave numbers x, y, z.

    Component i is even across the stream but odd in its own direction: cosines and sines, padded
    along the stream so that nothing wraps around.
    """

    viscous: Complex[Array, "kx ky kz"]
    potential: Complex[Array, "kx ky kz"]
    step: float = eqx.field(static=True)

    def __call__(self, force: Float[AnyArray, "3 nx ny nz"]) -> Float[Array, "3 nx ny nz"]:
        """Return the velocity on faces due to a force density on faces: one convolution with G."""
        nx, *across = force.shape[1:]
        period = _period(nx)
        waves = [_Waves(cells, self.step, force.dtype) for cells in across]
        k_y, k_z = waves[0].numbers[:, None], waves[1].numbers
        shift = (np.exp(2j * np.pi * np.arange(period // 2 + 1) / period) - 1) / self.step
        ahead = jnp.asarray(shift[:, None, None], self.viscous.dtype)  # D+x; D-x is -conj
        g, q = self.viscous, self.potential

        fx, fy, fz = (
            waves[1].forward(waves[0].forward(jnp.fft.rfft(part, n=period, axis=0), 1, odd), 2, own)
            for part, odd, own in zip(force, (0, 1, 0), (0, 0, 1), strict=True)
        )
        sources = k_y * fy + k_z * fz
        phi = q * (sources - jnp.conj(ahead) * fx)
        velocity = (
            -(q * ((k_y**2 + k_z**2) * fx + ahead * sources)),
            g * fy + k_y * phi,
            g * fz + k_z * phi,
        )
        return jnp.stack(
            [
                jnp.fft.irfft(
                    waves[0].backward(waves[1].backward(part, 2, own), 1, odd), n=period, axis=0
                )[:nx]
                for part, odd, own in zip(velocity, (0, 1, 0), (0, 0, 1), strict=True)
            ]
        )


class _Waves:
    """Transforms across the stream and back: cosines of even components, sines of odd ones."""

    def __init__(self, cells, step, dtype):
        psi = _padded_waves(cells)
        row = np.arange(cells)[:, None]
        matrices = np.cos(psi * (row + 0.5)), np.sin(psi * (row + 1))
        weight = np.where((psi == 0) | (psi == np.pi), 1.0, 2.0) / (2 * cells + 1)
        self.numbers = jnp.asarray(2 * np.sin(psi / 2) / step, dtype)
        self._forward = [jnp.asarray(m, dtype) for m in matrices]
        self._backward = [jnp.asarray((m * weight).T, dtype) for m in matrices]

    def forward(self, field, axis, odd):
        return _contract(field, self._forward[odd], axis)

    def backward(self, field, axis, odd):
        return _contract(field, self._backward[odd], axis)


def _contract(field, matrix, axis):
    """Apply a real matrix along an axis of a complex field, both parts in one product."""
    parts = jnp.stack([field.real, field.imag])
    product = jnp.moveaxis(jnp.tensordot(parts, matrix, axes=[[axis + 1], [0]]), -1, axis + 1)
    return product[0] + 1j * product[1]


def _padded_waves(cells):
    """Return the psi across with which sources and images do not wrap around in the domain."""
    return np.pi * np.arange(2 * cells + 2) / (2 * cells + 1)


def _period(nx):
    return next_fast_len(2 * nx + 1, real=True)


def space_kernel(lattice: Lattice, reynolds: Float[AnyArray, ""]) -> SpaceKernel:
    """Return the Green's function of the Oseen operator on a quarter of an unbounded stream."""
    nx, *across = lattice.shape
    heat = [_heat(cells) for cells in across]
    period = _period(nx)

    def spectrum(columns, power):
        weights, fit, spread = _exponentials(power)
        # displacements -nx ... nx about the source, laid out as FFTs have them
        padded = jnp.zeros((period, columns.shape[1])).at[np.arange(-nx, nx + 1)].set(columns[1:])
        amplitude = jnp.fft.rfft(((padded * weights) @ fit) @ spread, axis=0)
        return jnp.einsum("xk,ky,kz->xyz", amplitude, *heat)

    viscous, potential = sequences(lattice, reynolds, BETAS)
    return SpaceKernel(spectrum(viscous, 0.5), spectrum(potential, 1.5), lattice.step[0])


@functools.cache
def _exponentials(power):
    """Return row weights, and two factors of the pseudo-inverse that fits exponentials to columns.

    The explicit pseudo-inverse would lose accuracy to 1e-3; its two factors do not.
    """
    weights = np.minimum(BETAS, 1.0) ** power
    design = weights[:, None] * np.exp(-np.outer(BETAS, TIMES))
    scale = np.linalg.norm(design, axis=0)
    left, size, right = np.linalg.svd(design / scale, full_matrices=False)
    kept = size > SINGULAR_CUT * size[0]
    return weights, left[:, kept], (right[kept] / size[kept, None]) / scale


@functools.cache
def _heat(cells):
    """Return the heat kernels at all times in the wave numbers across."""
    n = np.arange(2 * cells + 1)
    kernels = _decaying_bessel(n, 2 * TIMES[:, None]) * np.where(n == 0, 1.0, 2.0)
    return kernels @ np.cos(np.outer(n, _padded_waves(cells)))


def _decaying_bessel(n, x):
    """Return exp(-x) I_n(x); SciPy's ends at 1e9, where three terms of its expansion are exact."""
    large = np.maximum(x, LARGEST_X)
    total = term = np.ones(np.broadcast_shapes(n.shape, x.shape))
    for k in (1, 2, 3):
        term = -term * (4 * n**2 - (2 * k - 1) ** 2) / (k * 8 * large)
        total = total + term
    return np.where(
        x < LARGEST_X,
        ive(n, np.minimum(x, LARGEST_X)),
        total / np.sqrt(2 * np.pi * large),
    )
