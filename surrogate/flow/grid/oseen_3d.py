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
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
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
    """The Green's function G in 3-D: spectra of g and Q, padded so that nothing wraps around.

    Across folded axes of the lattice component i is even but odd in its own direction: cosines and
    sines. Along the others waves are complex.
    """

    viscous: Complex[Array, "kx ky kz"]
    potential: Complex[Array, "kx ky kz"]
    step: float = eqx.field(static=True)
    folded: tuple[int, ...] = eqx.field(static=True)

    def __call__(self, force: Float[AnyArray, "3 nx ny nz"]) -> Float[Array, "3 nx ny nz"]:
        """Return the velocity on faces due to a force density on faces: one convolution with G."""
        nx, *across = force.shape[1:]
        period, dtype = _period(nx), self.viscous.dtype
        y, z = (_waves(cells, k + 1 in self.folded) for k, cells in enumerate(across))
        # D- of the components across, and minus D+ of a scalar, in wave numbers
        div_y, div_z = (jnp.asarray(w.divergence / self.step, dtype) for w in (y, z))
        grad_y, grad_z = jnp.conj(div_y)[:, None], jnp.conj(div_z)
        div_y = div_y[:, None]
        shift = (np.exp(2j * np.pi * np.arange(period // 2 + 1) / period) - 1) / self.step
        ahead = jnp.asarray(shift[:, None, None], dtype)  # D+x; D-x is -conj
        g, q = self.viscous, self.potential

        def forward(part, own):
            along = jnp.fft.rfft(_padded(part, period, 0), axis=0)
            return z.forward(y.forward(along, 1, own == 1), 2, own == 2)

        def backward(part, own):
            along = y.backward(z.backward(part, 2, own == 2), 1, own == 1)
            return jnp.fft.irfft(along, n=period, axis=0)[:nx]

        fx, fy, fz = (forward(part, own) for own, part in enumerate(force))
        sources = div_y * fy + div_z * fz
        phi = q * (sources - jnp.conj(ahead) * fx)
        across = (div_y * grad_y + div_z * grad_z).real  # minus the Laplacian across
        velocity = (
            -(q * (across * fx + ahead * sources)),
            g * fy + grad_y * phi,
            g * fz + grad_z * phi,
        )
        return jnp.stack([backward(part, own) for own, part in enumerate(velocity)])


class _FoldedWaves:
    """Cosines of even components and sines of odd ones, across a mirror plane."""

    def __init__(self, cells):
        self.psi = np.pi * np.arange(2 * cells + 2) / (2 * cells + 1)
        self.divergence = 2 * np.sin(self.psi / 2)
        row = np.arange(cells)[:, None]
        matrices = np.cos(self.psi * (row + 0.5)), np.sin(self.psi * (row + 1))
        ends = (self.psi == 0) | (self.psi == np.pi)
        weight = np.where(ends, 1.0, 2.0) / (2 * cells + 1)
        self._forward, self._backward = matrices, [(m * weight).T for m in matrices]
        self.reach = 2 * cells  # of the sources' images

    def forward(self, field, axis, odd):
        return _contract(field, self._forward[odd], axis)

    def backward(self, field, axis, odd):
        return _contract(field, self._backward[odd], axis)


class _WholeWaves:
    """Complex waves along an axis without a mirror plane."""

    def __init__(self, cells):
        self.cells, self.reach, self._period = cells, cells, _period(cells)
        self.psi = 2 * np.pi * np.arange(self._period) / self._period
        self.divergence = 1 - np.exp(-1j * self.psi)

    def forward(self, field, axis, odd):
        return jnp.fft.fft(_padded(field, self._period, axis), axis=axis)

    def backward(self, field, axis, odd):
        whole = jnp.fft.ifft(field, axis=axis)
        return jax.lax.slice_in_dim(whole, 0, self.cells, axis=axis)


def _padded(field, length, axis):
    """Append zeros along an axis up to a length.

    The padding of ``jnp.fft`` would be negative padding in the adjoint, for which XLA's older
    emitters for CPUs have no code.
    """
    shape = list(field.shape)
    shape[axis] = length - shape[axis]
    return jnp.concatenate([field, jnp.zeros(shape, field.dtype)], axis=axis)


@functools.cache
def _waves(cells, folded):
    return _FoldedWaves(cells) if folded else _WholeWaves(cells)


def _contract(field, matrix, axis):
    """Apply a real matrix along an axis of a complex field, both parts in one product."""
    parts, matrix = jnp.stack([field.real, field.imag]), jnp.asarray(matrix, field.real.dtype)
    product = jnp.moveaxis(jnp.tensordot(parts, matrix, axes=[[axis + 1], [0]]), -1, axis + 1)
    return product[0] + 1j * product[1]


def _period(cells):
    return next_fast_len(2 * cells + 1, real=True)


def space_kernel(
    lattice: Lattice, reynolds: Float[AnyArray, ""], dtype: DTypeLike = jnp.float64
) -> SpaceKernel:
    """Return the Green's function of the Oseen operator in an unbounded 3-D stream on a lattice.

    It is computed in double precision, whatever ``dtype`` the result has: the exponentials cancel.
    """
    nx, *across = lattice.shape
    heat = [_heat(cells, k + 1 in lattice.folded) for k, cells in enumerate(across)]
    period = _period(nx)

    def spectrum(columns, power):
        weights, fit, spread = _exponentials(power)
        # displacements -nx ... nx about the source, laid out as FFTs have them
        padded = jnp.zeros((period, columns.shape[1])).at[np.arange(-nx, nx + 1)].set(columns[1:])
        amplitude = jnp.fft.rfft(((padded * weights) @ fit) @ spread, axis=0)
        spectrum = jnp.einsum("xk,ky,kz->xyz", amplitude, *heat)
        return spectrum.astype(jnp.result_type(jnp.dtype(dtype), jnp.complex64))

    viscous, potential = sequences(lattice, reynolds, BETAS)
    spectra = spectrum(viscous, 0.5), spectrum(potential, 1.5)
    return SpaceKernel(*spectra, lattice.step[0], lattice.folded)


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
def _heat(cells, folded):
    """Return the heat kernels at all times in the wave numbers across."""
    waves = _waves(cells, folded)
    n = np.arange(waves.reach + 1)
    kernels = _decaying_bessel(n, 2 * TIMES[:, None]) * np.where(n == 0, 1.0, 2.0)
    return kernels @ np.cos(np.outer(n, waves.psi))


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
