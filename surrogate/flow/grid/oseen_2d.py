"""Green's function of the discrete Oseen operator: infinite in x, in y infinite or between walls.

The lattice operator is ``L u = D0x u - nu Lap u + grad p = f, div u = 0`` on the staggered
grid (free stream U = 1 along +x, central differences).  In wave numbers ``theta`` across the
stream it reduces to geometric sequences along the stream, so a kernel column is a sum of powers
and the kernel needs no outflow condition.  Unbounded streams integrate over ``theta`` by graded
Gauss-Legendre panels; tunnels sum over the wave numbers of the source and its images in the walls.
"""

import dataclasses
import functools
import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Complex, Float, Int

from surrogate.arrays import AnyArray
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.waves import half, joined, joined_part, wave_numbers, waves_across


class Kernel(eqx.Module):
    """The Green's function G, as a spectrum between cosines and sines about a lattice's middle.

    Across the stream, even components of fields are transformed to cosines and odd ones to sines,
    by small matrices. Forces with a mirror plane need the upper half of the lattice; others are
    split into a part that is its own mirror image and one that is minus its mirror image. Wave
    numbers across come first, so that the Fourier transforms run along the last axis.

    Attributes:
      spectra: for the two parts; one in an unbounded stream, where it serves both, and for forces
        with a mirror plane, which have no second part.
      folded: whether the lattice is the half above a mirror plane.
      is_transposed: whether this is the transpose of G, that of the reversed stream.
    """

    spectra: Complex[Array, "parts 2 2 ky kx"]
    folded: bool = eqx.field(static=True)
    is_transposed: bool = eqx.field(static=True, default=False)

    @property
    def transposed(self) -> "Kernel":
        """The transpose of G; in wave numbers its spectrum is the adjoint of that of G."""
        return dataclasses.replace(self, is_transposed=not self.is_transposed)

    def __call__(self, force: Float[AnyArray, "2 nx ny"]) -> Float[Array, "2 nx ny"]:
        """Return the velocity on faces due to a force density on faces: one convolution with G."""
        if self.folded:
            return self._of_part(force, 0)
        found = [self._of_part(_stacked(half(tuple(force), 1, odd)), odd) for odd in (0, 1)]
        return jnp.stack(joined(_components(jnp.stack(found, axis=1)), axis=1))

    def of_parity(
        self, force: Float[AnyArray, "2 nx ny"], odd: Int[AnyArray, ""]
    ) -> Float[AnyArray, "2 nx ny"]:
        """Return the velocity due to a force that is its own mirror image, or minus it (``odd`` 1).

        The lattice is not folded, and the force vanishes on the outermost faces, which have no
        mirror image. This takes half of the time.
        """
        found = self._of_part(_stacked(half(tuple(force), 1, odd)), odd)
        return jnp.stack(joined_part(_components(found), 1, odd))

    def _of_part(self, force, odd):
        """Convolve the upper half of a force that has one of the two symmetries."""
        nx, rows = force.shape[1:]
        transforms = _transforms(rows, self.folded)
        if not isinstance(odd, int):  # else programs contain only the matrices that they use
            transforms = map(jnp.asarray, transforms)
        forward, backward = (jnp.asarray(each[odd], force.dtype) for each in transforms)
        spectrum = self.spectra[odd if len(self.spectra) == 2 else 0]
        if self.is_transposed:
            spectrum = jnp.conj(jnp.swapaxes(spectrum, 0, 1))
        lateral = jnp.einsum("cjk,cxj->ckx", forward, force)
        lateral = _multiply(spectrum, jnp.fft.rfft(lateral, n=2 * nx))
        lateral = jnp.fft.irfft(lateral, n=2 * nx)[..., :nx]
        return jnp.einsum("ckx,ckj->cxj", lateral, backward)


@functools.cache
def _transforms(rows, folded):
    """Return the matrices to cosines and sines across and back, of both parts and components.

    The second component has one row more than the first if the lattice is not folded: that on the
    mirror plane. In the odd part the second component has the opposite sign, by which one spectrum
    serves both parts.
    """
    kinds = []
    for parity in (1, -1):
        waves = waves_across(rows if folded else rows - 1, parity, plane=not folded)
        missing = rows - len(waves.centred[0])
        forward = np.pad(waves.centred[0], ((0, missing), (0, 0))), parity * waves.faces[0]
        backward = np.pad(waves.centred[1], ((0, 0), (0, missing))), parity * waves.faces[1]
        kinds.append((np.stack(forward), np.stack(backward)))
    return tuple(map(np.stack, zip(*kinds, strict=True)))


def _stacked(field):
    """Stack the components of the upper half of a field, the first with zeros in its last row."""
    u, v = field
    return jnp.stack([jnp.pad(u, ((0, 0), (0, 1))), v])


def _components(field):
    """Return the components, the first without its additional row."""
    return field[0][..., :-1], field[1]


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
    dtype: DTypeLike = jnp.float64,
) -> Kernel:
    """Return the Green's function of the Oseen operator on a lattice.

    Args:
      lattice: the grid, with an even number of rows; a folded one is the upper half of the stream.
      reynolds: U D / nu.
      height: of a tunnel with slip walls in D, a whole, even number of cells; None for an unbounded
        stream.
      dtype: of the velocities that the kernel returns for forces of the same dtype.
    """
    cells = lattice.unfolded.shape[1] // 2
    if height is None:
        waves = [_unbounded_waves(4 * cells)]
    else:
        waves = _tunnel_waves(lattice.rows(height))[: 1 if lattice.folded else 2]
    spectra = [_spectrum(lattice, reynolds, cells, *pair, dtype) for pair in waves]
    return Kernel(jnp.stack(spectra), bool(lattice.folded))


def _tunnel_waves(period):
    """Return the wave numbers across a tunnel and their weights, for both parts of a force.

    With its images in the walls a force that is its own mirror image is periodic, and one that is
    minus its mirror image changes its sign after each period. The mean across of the first vanishes
    as mass is conserved.
    """
    index = np.arange(1, period // 2 + 1)
    even = np.where(2 * index == period, 1.0, 2.0) / period
    odd = np.full(period // 2, 2.0 / period)
    return (2 * np.pi * index / period, even), (2 * np.pi * (index - 0.5) / period, odd)


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


def _spectrum(lattice, reynolds, cells, theta, weight, dtype):
    """Return G between cosines and sines across, from a sum over wave numbers theta.

    The lattice has ``cells`` rows on either side of its middle.
    """
    psi = wave_numbers(cells)
    whole = np.arange(-2 * cells, 2 * cells + 1)
    half = whole[:-1] + 0.5
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
