"""The lattice Green's function G solves the discrete Oseen equations to round-off."""

import dataclasses
import functools
import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from surrogate.flow.grid.lattice import Lattice, mirror_image
from surrogate.flow.grid.oseen_2d import oseen_kernel

H = 1 / 8
LATTICE = Lattice((40, 32), (H, H), 12)
INSIDE = (slice(2, -2), slice(2, -2))


def random_force(generator):
    force = np.zeros((2, *LATTICE.shape))
    force[:, 10:20, 10:20] = generator.normal(size=(2, 10, 10))
    return jnp.asarray(force)


@functools.partial(jax.jit, static_argnames=("lattice", "height"))
def driven(lattice, reynolds, height, force):
    """Velocity that a force density drives: one convolution with G."""
    return oseen_kernel(lattice, reynolds, height)(force)


def laplacian(a):
    neighbours = sum(jnp.roll(a, s, axis) for s in (1, -1) for axis in (0, 1))
    return (neighbours - 4 * a) / H**2


def momentum_defect(velocity, force, reynolds):
    """Discrete curl of D0x u - nu Lap u - f, which no pressure can hide."""
    defect = [
        (jnp.roll(c, -1, 0) - jnp.roll(c, 1, 0)) / (2 * H) - laplacian(c) / reynolds - f
        for c, f in zip(velocity, force, strict=True)
    ]
    curl = (jnp.roll(defect[1], -1, 0) - defect[1]) - (jnp.roll(defect[0], -1, 1) - defect[0])
    return curl / H


# Re 16 makes the cell Reynolds number exactly 2, where the closed form has a removable pole
@pytest.mark.parametrize("reynolds", [1e-3, 0.1, 1.0, 16.0, 40.0, 300.0])
@pytest.mark.parametrize("height", [None, 6.0])
def test_exact_kernel_is_divergence_free_and_solves_oseen(reynolds, height, generator):
    force = random_force(generator)
    u, v = velocity = driven(LATTICE, jnp.asarray(reynolds), height, force)
    divergence = (u - jnp.roll(u, 1, 0) + v - jnp.roll(v, 1, 1)) / H
    size = float(jnp.abs(velocity).max())
    assert float(jnp.abs(divergence[INSIDE]).max()) < 1e-14 * max(1, size) / H
    assert float(jnp.abs(momentum_defect(velocity, force, reynolds)[INSIDE]).max()) < 1e-9


def test_exact_kernels_of_a_batch_equal_single_ones(generator):
    """Each with its own Re."""
    force, numbers = random_force(generator), jnp.array([0.01, 1.0, 16.0, 100.0])
    batch = jax.jit(jax.vmap(lambda re: driven(LATTICE, re, None, force)))(numbers)
    for row, reynolds in zip(batch, numbers, strict=True):
        assert np.allclose(row, driven(LATTICE, reynolds, None, force), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("reynolds", [1.0, 40.0])
def test_exact_kernel_of_a_long_periodic_lattice(reynolds, generator):
    """Against the same operator inverted by FFT on a lattice of 16384 columns.

    Across the stream that lattice holds the tunnel and its image in a wall.
    """
    rows, columns = 16, 16384
    lattice = Lattice((24, rows), (H, H), 8)
    force = np.zeros((2, 24, rows))
    force[:, 6:14, 4:12] = generator.normal(size=(2, 8, 8))
    force[0] -= force[0].mean(axis=1, keepdims=True)  # theta = 0 never decays on a periodic lattice
    velocity = driven(lattice, jnp.asarray(reynolds), rows * H, jnp.asarray(force))

    fx, fy = np.fft.fftfreq(columns) * 2 * np.pi, np.fft.fftfreq(2 * rows) * 2 * np.pi
    zx, zy = np.exp(1j * fx)[:, None], np.exp(1j * fy)[None]
    forward = np.broadcast_arrays((zx - 1) / H, (zy - 1) / H)
    backward = np.broadcast_arrays((1 - 1 / zx) / H, (1 - 1 / zy) / H)
    lap = sum(f * b for f, b in zip(forward, backward, strict=True))
    lap[0, 0] = 1.0
    sigma = (zx - 1 / zx) / (2 * H) - lap / reynolds
    sigma[:, 0] = 1.0
    padded = np.zeros((2, columns, 2 * rows))
    padded[:, :24, :rows] = force
    padded[:, :24, rows:] = mirror_image(force, 1)
    spectrum = np.fft.fft2(padded)
    pressure = sum(b * s for b, s in zip(backward, spectrum, strict=True)) / lap
    expected = [
        np.fft.ifft2((s - f * pressure) / sigma).real
        for s, f in zip(spectrum, forward, strict=True)
    ]
    error = np.abs(np.asarray(velocity) - np.array(expected)[:, :24, :rows]).max()
    assert error < 1e-9, f"largest difference {error:.1e}"


@pytest.mark.parametrize("height", [None, 6.0])
@pytest.mark.parametrize("parity", [1, -1])
def test_exact_kernel_of_forces_that_are_their_mirror_image_or_minus_it(parity, height, generator):
    force = LATTICE.symmetrised(random_force(generator), parity)
    kernel = eqx.filter_jit(oseen_kernel)(LATTICE, jnp.asarray(7.0), height)
    found = eqx.filter_jit(kernel.of_parity)(force, jnp.asarray((1 - parity) // 2))
    whole = eqx.filter_jit(kernel)(force)
    np.testing.assert_allclose(found, whole, atol=1e-12 * float(jnp.abs(whole).max()))
    images = LATTICE.symmetrised(found, parity)
    np.testing.assert_allclose(found[..., :-1], images[..., :-1], rtol=0, atol=0)


@pytest.mark.parametrize("height", [None, 4.0, 8.0])
@pytest.mark.parametrize("folded", [(), (1,)])
def test_exact_transposed_kernel(folded, height, generator):
    """Of every force and field, those at the edges included."""
    periodic = height == LATTICE.shape[1] * H
    shape = (40, 16) if folded else LATTICE.shape
    lattice = dataclasses.replace(LATTICE, shape=shape, folded=folded, periodic=periodic)
    kernel = eqx.filter_jit(oseen_kernel)(lattice, jnp.asarray(20.0), height)
    force, field = jnp.asarray(generator.normal(size=(2, 2, *shape)))

    @eqx.filter_jit
    def transposed(kernel, force, field):
        """By JAX and by the kernel; and the transpose of the transpose beside the kernel."""
        by_jax = jax.linear_transpose(kernel, force)(field)[0]
        twice = kernel.transposed.transposed(force)
        return by_jax, kernel.transposed(field), twice, kernel(force)

    expected, found, twice, once = transposed(kernel, force, field)
    tolerance = 1e-13 * float(jnp.abs(expected).max())
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(twice, once)


def test_order_unbounded_kernel_is_the_limit_of_tall_tunnels(generator):
    """Removing the walls changes the kernel by O(1/H): the difference halves with H doubled."""
    force = random_force(generator)
    reynolds = jnp.asarray(10.0)
    unbounded = driven(LATTICE, reynolds, None, force)
    gaps = [
        float(jnp.abs(driven(LATTICE, reynolds, h, force) - unbounded).max())
        for h in (32.0, 64.0, 128.0)
    ]
    ratios = [a / b for a, b in itertools.pairwise(gaps)]
    assert all(1.8 < ratio < 2.2 for ratio in ratios), f"gaps {gaps}"


def test_exact_kernel_commutes_with_reflection(generator):
    force = random_force(generator)
    for height in (None, 6.0):
        drive = functools.partial(driven, LATTICE, jnp.asarray(20.0), height)
        difference = mirror_image(drive(force), 1) - drive(mirror_image(force, 1))
        assert float(jnp.abs(difference[:, :, :-1]).max()) < 1e-13


def test_exact_slip_walls_are_stream_lines(generator):
    """With mirror images no fluid crosses the walls of the tunnel."""
    force = random_force(generator)
    height = LATTICE.shape[1] * H
    velocity = driven(LATTICE, jnp.asarray(20.0), height, force)
    assert float(jnp.abs(velocity[1, :, -1]).max()) < 1e-13


def test_exact_convection_adds_no_force(generator):
    """In flux form the convection of any velocity sums to zero over the domain."""
    velocity = LATTICE.cutoff() * generator.normal(size=(2, *LATTICE.shape))
    total = jnp.sum(LATTICE.convect(jnp.asarray(velocity)), axis=(1, 2))
    assert float(jnp.abs(total).max()) < 1e-10


@pytest.mark.parametrize("height", [None, 4.0, 8.0])
def test_exact_half_a_domain_gives_the_whole_of_a_symmetric_flow(height, generator):
    """Kernel and convection on the upper half agree with the whole domain."""
    half = dataclasses.replace(
        LATTICE, shape=(40, 16), folded=(1,), periodic=height == LATTICE.shape[1] * H
    )
    field = jnp.asarray(generator.normal(size=(2, *half.shape))) * half.cutoff()
    if half.periodic:
        field = field.at[1, :, -1].set(0.0)
    reynolds = jnp.asarray(20.0)
    whole = driven(half.unfolded, reynolds, height, half.unfold(field))
    assert np.allclose(half.unfold(driven(half, reynolds, height, field)), whole, atol=1e-13)
    convected = half.unfolded.convect(half.unfold(field))
    assert np.allclose(half.unfold(half.convect(field)), convected, atol=1e-11)
