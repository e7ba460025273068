"""Green's function of the discrete Oseen operator: infinite in x, periodic or infinite in y.

The lattice operator is ``L u = D0x u - nu Lap u + grad p = f, div u = 0`` on the staggered
grid (free stream U = 1 along +x, central differences).  In wave numbers ``theta`` across the
stream it reduces to geometric sequences along the stream, so a kernel column is a sum of powers
and the kernel needs no outflow condition.  Unbounded streams integrate over ``theta`` by graded
Gauss-Legendre panels; tunnels sum over the wave numbers of their period.
"""

import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from surrogate.arrays import AnyArray
from surrogate.flow.lattice import Lattice


class Kernel(eqx.Module):
    """Zero-padded spectrum of the Green's function, ready to convolve with a force density."""

    direct: Complex[Array, "2 2 kx ky"]
    mirror: Complex[Array, "2 2 kx ky"] | None

    def __call__(self, force: Float[AnyArray, "2 nx ny"]) -> Float[AnyArray, "2 nx ny"]:
        """Velocity on faces caused by a force density on faces (one application of G)."""
        shape = force.shape[1:]
        padded = (2 * shape[0], 2 * shape[1])
        spectrum = _multiply(self.direct, jnp.fft.rfft2(force, s=padded))
        if self.mirror is not None:
            spectrum += _multiply(self.mirror, jnp.fft.rfft2(reflect(force), s=padded))
        return jnp.fft.irfft2(spectrum, s=padded)[:, : shape[0], : shape[1]]


def reflect(field: Float[AnyArray, "2 nx ny"]) -> Float[AnyArray, "2 nx ny"]:
    """Mirror image of a face field in the window's centre line; u is even, v is odd.

    v sits on the upper faces, so the mirror of its row j is row ny - 2 - j; the outermost row
    has no partner inside the window and is zero, as every windowed source is there.
    """
    v = jnp.roll(field[1, :, ::-1], -1, axis=1).at[:, -1].set(0.0)
    return jnp.stack([field[0, :, ::-1], -v])


def _multiply(kernel, spectrum):
    return jnp.stack(
        [
            kernel[0, 0] * spectrum[0] + kernel[0, 1] * spectrum[1],
            kernel[1, 0] * spectrum[0] + kernel[1, 1] * spectrum[1],
        ]
    )


def oseen_kernel(
    lattice: Lattice, reynolds: Float[AnyArray, ""], height: float | None, mirrored: bool = False
) -> Kernel:
    """Kernel of the Oseen operator on ``lattice``.

    Args:
      lattice: the window's grid.
      reynolds: U D / nu.
      height: tunnel height in D, a whole number of cells; None for an unbounded stream.
      mirrored: the tunnel has slip walls and the source need not be symmetric about its centre
        line; then the kernel has period 2 H and carries the mirror image explicitly.
    """
    ny = lattice.shape[1]
    rows = np.arange(-ny, ny)
    if height is None:
        theta, weight = _unbounded_quadrature(2 * ny)
        return Kernel(_spectrum(lattice, reynolds, theta, weight, rows, None), None)
    period = lattice.rows(height)
    if not mirrored:
        return Kernel(_tunnel_spectrum(lattice, reynolds, period, rows), None)
    direct = _tunnel_spectrum(lattice, reynolds, 2 * period, rows)
    return Kernel(direct, _tunnel_spectrum(lattice, reynolds, 2 * period, rows - period))


def _tunnel_spectrum(lattice, reynolds, period, rows):
    """Wave numbers of a period of ``period`` rows, the negative ones folded onto the positive."""
    index = np.arange(1, period // 2 + 1)
    weight = np.where(2 * index == period, 1.0, 2.0) / period
    return _spectrum(lattice, reynolds, 2 * np.pi * index / period, weight, rows, 1.0 / period)


def _unbounded_quadrature(rows, nodes=16, panels=13, ratio=4.0):
    """Nodes and weights for (1/pi) int_0^pi: panels shrink towards the kernel's kink at 0."""
    edges = np.concatenate([[0.0], np.pi * ratio ** -np.arange(panels, -1.0, -1.0)])
    theta, weight = [], []
    for left, right in itertools.pairwise(edges):
        x, w = np.polynomial.legendre.leggauss(nodes + int(rows * (right - left) / 4))
        theta.append(left + (right - left) * (x + 1) / 2)
        weight.append(w * (right - left) / 2 / np.pi)
    return np.concatenate(theta), np.concatenate(weight)


def _spectrum(lattice, reynolds, theta, weight, rows, mean_weight):
    """FFT of the kernel on displacements n in [-nx, nx) and the given ``rows``.

    ``mean_weight`` is the weight of theta = 0 (a tunnel's mean flow), None where it has none.
    """
    nx = lattice.shape[0]
    hy = lattice.step[1]
    n = np.arange(-nx - 1, nx + 1)
    viscous, potential, lateral = _columns(lattice, reynolds, theta, n)
    slope = jnp.diff(potential, axis=0) / lattice.step[0]  # D+x Q on n = -nx-1 ... nx-1
    half = 2 * np.sin(theta / 2) / hy * weight
    even = np.cos(np.outer(theta, rows)) * weight[:, None]
    odd_xy = np.sin(np.outer(theta, rows - 0.5)) * half[:, None]
    odd_yx = np.sin(np.outer(theta, rows + 0.5)) * half[:, None]
    gxx = (lateral * potential)[1:-1] @ even
    gyy = viscous[1:-1] @ even - gxx
    gxy = slope[1:] @ odd_xy
    gyx = slope[:-1] @ odd_yx
    if mean_weight is not None:
        gyy += mean_weight * _mean_column(lattice, reynolds, n[1:-1])[:, None]
    kernel = jnp.stack([jnp.stack([gxx, gxy]), jnp.stack([gyx, gyy])])
    return jnp.fft.rfft2(jnp.fft.ifftshift(kernel, axes=(-2, -1)))


def _columns(lattice, reynolds, theta, n):
    """Along-stream sequences g_s (viscous), Q = Lap^-1 sigma^-1 (potential), and l_y.

    With P = h U / nu and beta the lateral eigenvalue, sigma has the decaying roots r (downstream)
    and s (upstream), Lap the root rho; Q is the convolution of the two, summed in closed form.
    """
    hx, hy = lattice.step
    beta = (2 * hx / hy * np.sin(theta / 2)) ** 2
    P = hx * reynolds
    root = np.sqrt(beta + beta**2 / 4)
    rho = 1 / (1 + beta / 2 + root)
    laplace = -(hx**2) / (2 * root)
    discriminant = jnp.sqrt(4 * beta + beta**2 + P**2)
    total = 2 + beta + discriminant
    r, s = (2 + P) / total, (2 - P) / total
    c = hx**2 * reynolds / discriminant
    m = np.abs(n)[:, None]
    downstream = (n >= 0)[:, None]
    rho_m, r_m, s_m = jnp.power(rho, m), jnp.power(r, m), jnp.power(s, m)
    viscous = c * jnp.where(downstream, r_m, s_m)
    overlap_r, overlap_s = rho * r / (1 - rho * r), rho * s / (1 - rho * s)
    ahead = (r * r_m - rho * rho_m) / (r - rho) + r_m * overlap_r + rho_m * overlap_s
    behind = rho_m / (1 - rho * r) + s * (rho_m - s_m) / (rho - s) + s_m * overlap_s
    potential = laplace * c * jnp.where(downstream, ahead, behind)
    return viscous, potential, -beta / hx**2


def _mean_column(lattice, reynolds, n):
    """g_s at theta = 0: the mean lateral velocity of a tunnel (mass forbids a mean of u')."""
    P = lattice.step[0] * reynolds
    return lattice.step[0] * jnp.where(n >= 0, 1.0, jnp.power((2 - P) / (2 + P), np.abs(n)))
