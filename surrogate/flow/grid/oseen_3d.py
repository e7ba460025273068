"""Green's function of the discrete Oseen operator in 3-D, unbounded along and across the stream.

The lattice operator is that of 2-D, with equal steps. Its kernel follows from two scalars, g =
sigma^-1 and Q = Lap^-1 sigma^-1: with beta = beta_y + beta_z

    xx = -(beta / h^2) Q,  yy = g + (beta_y / h^2) Q,  zz = g + (beta_z / h^2) Q,  ij = -D+i D-j Q.

Across the stream g and Q depend on beta alone. As sums of exp(-t beta), fitted column by column,
they need no integrals over wave numbers: the exponentials factor into the two directions, and
each is the heat kernel of a one-dimensional lattice, exp(-2t) I_n(2t) at distance n.
"""

import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Complex, Float, Int
from scipy.fft import next_fast_len
from scipy.special import ive

from surrogate.arrays import AnyArray
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.oseen_2d import sequences
from surrogate.flow.grid.waves import (
    contract,
    half,
    halves,
    joined,
    joined_part,
    wave_numbers,
    waves_across,
)

# Times t of the exponentials and points beta of their fit, from the far field of the largest
# lattice to the shortest waves: G to 1e-10 of its largest value (study ``constants``).
TIMES = np.append(0.0, np.exp(np.arange(-5.0, 31.0, 0.3)))
BETAS = np.exp(np.linspace(-32.0, np.log(8.0), 1000))
SINGULAR_CUT = 1e-13  # relative, below which singular values of the fit are dropped
LARGEST_X = 1e8  # argument of a Bessel function, beyond which its expansion is exact


class SpaceKernel(eqx.Module):
    """The Green's function G in 3-D: spectra of g and Q, padded so that nothing wraps around.

    Across the stream waves are cosines and sines about the middle of the lattice. Forces that have
    a mirror plane there, across folded axes, need half of them; others are split into a part that
    is its own mirror image and one that is minus its mirror image. ``is_transposed`` says whether
    this is the transpose of G, the Green's function of the reversed stream.
    """

    viscous: Complex[Array, "kx ky kz"]
    potential: Complex[Array, "kx ky kz"]
    step: float = eqx.field(static=True)
    folded: tuple[int, ...] = eqx.field(static=True)
    is_transposed: bool = eqx.field(static=True, default=False)

    @property
    def transposed(self) -> "SpaceKernel":
        """The transpose of G, whose spectra are the conjugates of those of G."""
        return dataclasses.replace(self, is_transposed=not self.is_transposed)

    def __call__(self, force: Float[AnyArray, "3 nx ny nz"]) -> Float[Array, "3 nx ny nz"]:
        """Return the velocity on faces due to a force density on faces: one convolution with G."""
        return jnp.stack(self._split_convolution(tuple(force)))

    def of_parity(
        self, force: Float[AnyArray, "3 nx ny nz"], odd: Int[AnyArray, ""]
    ) -> Float[Array, "3 nx ny nz"]:
        """Return the velocity due to a force that is its own mirror image, or minus it (``odd`` 1).

        The mirror plane is the middle of the last axis, which is not folded. This takes half of the
        time.
        """
        return jnp.stack(self._split_convolution(tuple(force), odd=odd))

    def _split_convolution(self, force, waves=(), odd=None):
        """Split along the axes across that have no waves yet, and convolve one part after another.

        One after another they stay in the cache, and are compiled once. Where ``odd`` is given the
        other part of the last axis vanishes.
        """
        axis = len(waves) + 1
        if axis == 3:
            return self._convolution(force, waves)
        cells, dtype = force[0].shape[axis], force[0].dtype
        if axis in self.folded:
            own = jax.tree.map(lambda m: jnp.asarray(m, dtype), waves_across(cells, 1, plane=False))
            return self._split_convolution(force, (*waves, own), odd)
        kinds = (waves_across(cells // 2, parity, plane=True) for parity in (1, -1))
        both = jax.tree.map(lambda *pair: jnp.asarray(np.stack(pair), dtype), *kinds)

        def convolution(part):
            return self._split_convolution(part[0], (*waves, part[1]), odd)

        if odd is None or axis == 1:
            return joined(jax.lax.map(convolution, (halves(force, axis), both)), axis)
        found = convolution((half(force, axis, odd), jax.tree.map(lambda leaf: leaf[odd], both)))
        return joined_part(found, axis, odd)

    def _convolution(self, force, waves):
        """Convolve the upper part of a force, which these waves across have the symmetries of."""
        nx, period, dtype = force[0].shape[0], _period(force[0].shape[0]), self.viscous.dtype
        # D- of the components across, and minus D+ of a scalar, in wave numbers
        by_y, by_z = ((wave.slope / self.step).astype(dtype) for wave in waves)
        by_y = by_y[:, None]
        shift = (np.exp(2j * np.pi * np.arange(period // 2 + 1) / period) - 1) / self.step
        ahead = jnp.asarray(shift[:, None, None], dtype)  # D+x; D-x is -conj
        g, q = self.viscous, self.potential
        if self.is_transposed:
            g, q = jnp.conj(g), jnp.conj(q)

        def forward(part, own):
            spectrum = jnp.fft.rfft(part, n=period, axis=0)
            for axis in (1, 2):
                spectrum = contract(spectrum, waves[axis - 1].of(own == axis)[0], axis)
            return spectrum

        def backward(part, own):
            for axis in (2, 1):
                part = contract(part, waves[axis - 1].of(own == axis)[1], axis)
            return jnp.fft.irfft(part, n=period, axis=0)[:nx]

        fx, fy, fz = (forward(part, own) for own, part in enumerate(force))
        sources = by_y * fy + by_z * fz
        phi = q * (sources - jnp.conj(ahead) * fx)
        across = (by_y**2 + by_z**2).real  # minus the Laplacian across
        velocity = -(q * (across * fx + ahead * sources)), g * fy + by_y * phi, g * fz + by_z * phi
        return tuple(backward(part, own) for own, part in enumerate(velocity))


def _period(cells):
    return next_fast_len(2 * cells + 1, real=True)


def space_kernel(
    lattice: Lattice, reynolds: Float[AnyArray, ""], dtype: DTypeLike = jnp.float64
) -> SpaceKernel:
    """Return the Green's function of the Oseen operator in an unbounded 3-D stream on a lattice.

    It is computed in double precision, whatever ``dtype`` the result has: the exponentials cancel.
    """
    nx, *across = lattice.shape
    heat = [
        _heat(cells if axis in lattice.folded else cells // 2)
        for axis, cells in enumerate(across, 1)
    ]
    across = jnp.einsum("ky,kz->kyz", *heat)
    period = _period(nx)

    def spectrum(columns, power):
        weights, fit, spread = _exponentials(power)
        # displacements -nx ... nx about the source, laid out as FFTs have them
        padded = jnp.zeros((period, columns.shape[1])).at[np.arange(-nx, nx + 1)].set(columns[1:])
        amplitude = jnp.fft.rfft(((padded * weights) @ fit) @ spread, axis=0)
        parts = jnp.concatenate([amplitude.real, amplitude.imag])  # complex products take longer
        parts = jnp.einsum("xk,kyz->xyz", parts, across).astype(dtype)
        return jax.lax.complex(*jnp.split(parts, 2))

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
def _heat(cells):
    """Return the heat kernels at all times in the wave numbers across."""
    n = np.arange(2 * cells + 1)  # as far as the images of the sources
    kernels = _decaying_bessel(n, 2 * TIMES[:, None]) * np.where(n == 0, 1.0, 2.0)
    return kernels @ np.cos(np.outer(n, wave_numbers(cells)))


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
