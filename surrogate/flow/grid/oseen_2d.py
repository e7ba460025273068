"""Green's function of the discrete Oseen operator: infinite in x, periodic or infinite in y.

The lattice operator is ``L u = D0x u - nu Lap u + grad p = f, div u = 0`` on the staggered
grid (free stream U = 1 along +x, central differences).  In wave numbers ``theta`` across the
stream it reduces to geometric sequences along the stream, so a kernel column is a sum of powers
and the kernel needs no outflow condition.  Unbounded streams integrate over ``theta`` by graded
Gauss-Legendre panels; tunnels sum over the wave numbers of their period.
"""

import functools
import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Complex, Float, Int

from surrogate.arrays import AnyArray
from surrogate.flow.grid.lattice import Lattice, mirror_image


class Kernel(eqx.Module):
    """The Green's function G as a zero-padded spectrum, ready to convolve with a force density."""

    direct: Complex[Array, "2 2 kx ky"]
    mirror: Complex[Array, "2 2 kx ky"] | None

    def __call__(self, force: Float[AnyArray, "2 nx ny"]) -> Float[AnyArray, "2 nx ny"]:
        """Return the velocity on faces due to a force density on faces: one convolution with G."""
        shape = force.shape[1:]
        padded = (2 * shape[0], 2 * shape[1])
        spectrum = _multiply(self.direct, jnp.fft.rfft2(force, s=padded))
        if self.mirror is not None:
            spectrum += _multiply(self.mirror, jnp.fft.rfft2(mirror_image(force, 1), s=padded))
        return jnp.fft.irfft2(spectrum, s=padded)[:, : shape[0], : shape[1]]

    def of_parity(
        self, force: Float[AnyArray, "2 nx ny"], odd: Int[AnyArray, ""]
    ) -> Float[AnyArray, "2 nx ny"]:
        """Return the velocity due to a force with a symmetry, at the cost of any other."""
        return self(force)


class SymmetricKernel(eqx.Module):
    """The Green's function G on an upper half plane, where u is even across the stream and v odd.

    Across, u is transformed to cosines and v to sines, by small matrices. In these wave numbers psi
    an even u and an odd v have real spectra, so half the rows and half the complex numbers suffice.
    Wave numbers across come first, so that the Fourier transforms run along the last axis.
    """

    spectrum: Complex[Array, "2 2 ky kx"]

    def __call__(self, force: Float[AnyArray, "2 nx ny"]) -> Float[Array, "2 nx ny"]:
        """Return the velocity on faces due to a force density on faces: one convolution with G."""
        nx, ny = force.shape[1:]
        forward, backward = (m.astype(force.dtype) for m in _cosines_and_sines(ny))
        lateral = jnp.einsum("cjk,cxj->ckx", forward, force)
        spectrum = _multiply(self.spectrum, jnp.fft.rfft(lateral, n=2 * nx))
        lateral = jnp.fft.irfft(spectrum, n=2 * nx)[..., :nx]
        return jnp.einsum("ckx,ckj->cxj", lateral, backward)


def _cosines_and_sines(ny):
    """Return the transforms of ny upper rows, padded so that nothing wraps around, and back."""
    psi = _padded_waves(ny)
    row = np.arange(ny)[:, None]
    forward = np.stack([np.cos(psi * (row + 0.5)), np.sin(psi * (row + 1))])
    weight = np.where(psi == 0, 1.0, 2.0) / (2 * ny)
    return forward, (forward * weight).transpose(0, 2, 1)


def _padded_waves(ny):
    return np.pi * np.arange(2 * ny + 1) / (2 * ny)


def _multiply(kernel, spectrum):
    return jnp.stack(
        [
            kernel[0, 0] * spectrum[0] + kernel[0, 1] * spectrum[1],
            kernel[1, 0] * spectrum[0] + kernel[1, 1] * spectrum[1],
        ]
    )


def oseen_kernel(
    lattice: Lattice,
    reynolds: Float[AnyArray, ""],
    height: float | None,
    mirrored: bool = False,
    dtype: DTypeLike = jnp.float64,
) -> Kernel | SymmetricKernel:
    """Return the Green's function of the Oseen operator on a lattice.

    Args:
      lattice: the grid; a folded one gets a kernel for its upper half.
      reynolds: U D / nu.
      height: tunnel height in D, a whole number of cells; None for an unbounded stream.
      mirrored: the tunnel has slip walls and the source need not be symmetric about its centre
        line; then the kernel has period 2 H and carries the mirror image explicitly.
      dtype: of the velocities that the kernel returns for forces of the same dtype.
    """
    ny = lattice.shape[1]
    if lattice.folded:
        waves = _unbounded_waves(4 * ny) if height is None else _tunnel_waves(lattice.rows(height))
        return SymmetricKernel(_half_spectrum(lattice, reynolds, *waves, dtype))
    rows = np.arange(-ny, ny)
    if height is None:
        waves = _unbounded_waves(2 * ny)
        return Kernel(_spectrum(lattice, reynolds, *waves, rows, None, dtype), None)
    period = lattice.rows(height) * (2 if mirrored else 1)
    waves = _tunnel_waves(period)
    images = (rows, rows - period // 2) if mirrored else (rows,)
    spectra = [_spectrum(lattice, reynolds, *waves, rows, 1 / period, dtype) for rows in images]
    return Kernel(*spectra) if mirrored else Kernel(*spectra, None)


def _tunnel_waves(period):
    """Return the wave numbers of a period, negative ones folded, and their weights."""
    index = np.arange(1, period // 2 + 1)
    return 2 * np.pi * index / period, np.where(2 * index == period, 1.0, 2.0) / period


@functools.cache
def _unbounded_waves(rows, nodes=12, panels=13, ratio=4.0):
    """Return nodes and weights for (1/pi) int_0^pi, on panels that shrink towards 0.

    Panels end at pi / ratio^k. Each has ``nodes`` points and one more for every four radians of
    phase of the fastest cosine. The defaults are accurate to 1e-12 (study ``constants``).
    """
    edges = np.concatenate([[0.0], np.pi * ratio ** -np.arange(panels, -1.0, -1.0)])
    theta, weight = [], []
    for left, right in itertools.pairwise(edges):
        x, w = np.polynomial.legendre.leggauss(nodes + int(rows * (right - left) / 4))
        theta.append(left + (right - left) * (x + 1) / 2)
        weight.append(w * (right - left) / 2 / np.pi)
    return np.concatenate(theta), np.concatenate(weight)


def _spectrum(lattice, reynolds, theta, weight, rows, mean_weight, dtype):
    """Return the FFT of the kernel on displacements n in [-nx, nx) and the given ``rows``.

    ``mean_weight`` is the weight of theta = 0 (a tunnel's mean flow), None where it has none.
    """
    xx, xy, yx, yy = _columns(lattice, reynolds, theta, dtype)
    even = (np.cos(np.outer(theta, rows)) * weight[:, None]).astype(dtype)
    odd_xy = (np.sin(np.outer(theta, rows - 0.5)) * weight[:, None]).astype(dtype)
    odd_yx = (np.sin(np.outer(theta, rows + 0.5)) * weight[:, None]).astype(dtype)
    gyy = yy @ even
    if mean_weight is not None:
        gyy += (mean_weight * _mean_column(lattice, reynolds)[:, None]).astype(dtype)
    kernel = jnp.stack([jnp.stack([xx @ even, xy @ odd_xy]), jnp.stack([yx @ odd_yx, gyy])])
    return jnp.fft.rfft2(jnp.fft.ifftshift(kernel, axes=(-2, -1)))


def _half_spectrum(lattice, reynolds, theta, weight, dtype):
    """Return the kernel between cosines and sines of the padded wave numbers psi across."""
    ny = lattice.shape[1]
    psi = _padded_waves(ny)
    whole, half = np.arange(-2 * ny, 2 * ny), np.arange(-2 * ny, 2 * ny) + 0.5
    even = np.cos(np.outer(theta, whole)) * weight[:, None] @ np.cos(np.outer(whole, psi))
    odd = np.sin(np.outer(theta, half)) * weight[:, None] @ np.sin(np.outer(half, psi))
    even, odd = even.astype(dtype), odd.astype(dtype)
    xx, xy, yx, yy = _columns(lattice, reynolds, theta, dtype)
    pairs = (even, xx), (odd, -xy), (odd, yx), (even, yy)
    kernel = jnp.stack([jnp.einsum("wp,nw->pn", waves, column) for waves, column in pairs])
    kernel = jnp.fft.rfft(jnp.fft.ifftshift(kernel, axes=-1))
    return kernel.reshape(2, 2, *kernel.shape[1:])


def _columns(lattice, reynolds, theta, dtype):
    """Return the kernel at wave numbers theta across, on displacements n in [-nx, nx) along x.

    It is computed in double precision: differences of neighbours would lose digits.
    """
    hx, hy = lattice.step
    beta = (2 * hx / hy * np.sin(theta / 2)) ** 2
    viscous, potential = sequences(lattice, reynolds, beta)
    slope = jnp.diff(potential, axis=0) / hx * (2 * np.sin(theta / 2) / hy)  # D+x D-y Q
    xx = (-beta / hx**2 * potential)[1:-1]
    columns = xx, slope[1:], slope[:-1], viscous[1:-1] - xx
    return [column.astype(dtype) for column in columns]


def sequences(
    lattice: Lattice, reynolds: Float[AnyArray, ""], beta: Float[AnyArray, " waves"]
) -> tuple[Float[Array, "displacements waves"], Float[Array, "displacements waves"]]:
    """Return g = sigma^-1 and Q = Lap^-1 sigma^-1 along x, at displacements n in [-nx - 1, nx + 1).

    sigma is the Oseen operator D0x - nu Lap and Lap the lattice's Laplacian. With P = h U / nu,
    sigma has the decaying roots r (downstream) and s (upstream), Lap the root rho; Q is the
    convolution of the two sequences, summed in closed form.

    Args:
      lattice: its first axis, along the stream.
      reynolds: U D / nu.
      beta: eigenvalues of the Laplacian across the stream, times -h^2.
    """
    h = lattice.step[0]
    m = np.arange(lattice.shape[0] + 2)[:, None]  # distance along the stream
    P = h * reynolds
    root = np.sqrt(beta + beta**2 / 4)
    rho = 1 / (1 + beta / 2 + root)
    laplace = -(h**2) / (2 * root)
    discriminant = jnp.sqrt(4 * beta + beta**2 + P**2)
    total = 2 + beta + discriminant
    r, s = (2 + P) / total, (2 - P) / total
    c = h**2 * reynolds / discriminant
    rho_m, r_m, s_m = np.power(rho, m), _powers(r, m), _powers(s, m)
    viscous = c * _both_ways(s_m, r_m)
    overlap_r, overlap_s = rho * r / (1 - rho * r), rho * s / (1 - rho * s)
    ahead = (r * r_m - rho * rho_m) / (r - rho) + r_m * overlap_r + rho_m * overlap_s
    behind = rho_m / (1 - rho * r) + s * (rho_m - s_m) / (rho - s) + s_m * overlap_s
    return viscous, laplace * c * _both_ways(behind, ahead)


def _powers(base, exponent):
    """Return base^m by exponentials, several times faster than powers; base may be negative."""
    size = jnp.abs(base)
    small = size < 1e-30
    magnitude = jnp.exp(exponent * jnp.log(jnp.where(small, 1.0, size)))
    signed = magnitude * jnp.where((base < 0) & (exponent % 2 == 1), -1.0, 1.0)
    return jnp.where(small, jnp.where(exponent == 1, base, exponent == 0), signed)


def _both_ways(upstream, downstream):
    """Join values at distances 0, 1, ... upstream and downstream to one sequence, -M to M - 1."""
    return jnp.concatenate([upstream[:0:-1], downstream[:-1]])


def _mean_column(lattice, reynolds):
    """Return g at theta = 0, the mean lateral velocity of a tunnel; mass forbids a mean of u'."""
    n = np.arange(-lattice.shape[0], lattice.shape[0])
    P = lattice.step[0] * reynolds
    return lattice.step[0] * jnp.where(n >= 0, 1.0, jnp.power((2 - P) / (2 + P), np.abs(n)))
