"""The body in the grid: traction modes spread by cubic B-splines, slip tested by the same modes."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.measures import moments
from surrogate.flow.grid.lattice import Lattice


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


class Spreading(eqx.Module):
    """Force densities B of all modes on a box of the window around the body.

    ``spread`` is the map from mode amplitudes to a force density on the grid, ``slip`` its
    transpose (times the cell area): the mode-weighted mean of a velocity on the contour.
    ``silent`` is the unit vector of uniform pressure, the traction that moves nothing.
    """

    density: Float[AnyArray, "modes 2 bx by"]
    silent: Float[AnyArray, " modes"]
    corner: tuple[int, int] = eqx.field(static=True)
    shape: tuple[int, int] = eqx.field(static=True)
    area: float = eqx.field(static=True)

    def spread(self, amplitude: Float[AnyArray, " modes"]) -> Float[AnyArray, "2 nx ny"]:
        local = jnp.tensordot(amplitude, self.density, axes=1)
        (i, j), (bx, by) = self.corner, self.density.shape[2:]
        return jnp.zeros((2, *self.shape), local.dtype).at[:, i : i + bx, j : j + by].set(local)

    def slip(self, velocity: Float[AnyArray, "2 nx ny"]) -> Float[AnyArray, " modes"]:
        (i, j), (bx, by) = self.corner, self.density.shape[2:]
        box = velocity[:, i : i + bx, j : j + by]
        return self.area * jnp.tensordot(self.density, box, axes=3)

    def slip_of_stream(self) -> Float[AnyArray, " modes"]:
        """Slip of the undisturbed stream (1, 0)."""
        return self.area * jnp.sum(self.density[:, 0], axis=(1, 2))


def outward(markers: Float[AnyArray, "nodes 2"]) -> Float[AnyArray, "nodes 2"]:
    """Outward normal times ds/dt of a clockwise contour given at equidistant t."""
    nodes = markers.shape[0]
    wave = np.fft.fftfreq(nodes, 1 / nodes)
    wave[nodes // 2] = 0.0
    tangent = jnp.fft.ifft(1j * wave[:, None] * jnp.fft.fft(markers, axis=0), axis=0).real
    return jnp.stack([-tangent[:, 1], tangent[:, 0]], axis=1)


def spread_modes(
    lattice: Lattice,
    modes: Modes,
    box: tuple[int, int],
    markers: Float[AnyArray, "nodes 2"],
) -> Spreading:
    """Spread all modes from the contour, the markers pulled inward a little."""
    normal = outward(markers)
    seats = _seats(lattice, markers, normal)
    below = 0 if lattice.symmetric else box[1] // 2  # rows of the box under the centre line
    centre = 0 if lattice.symmetric else lattice.shape[1] // 2
    corner, rows = (lattice.inlet - box[0] // 2, centre - below), below + box[1] // 2
    values = modes.values(markers.shape[0])
    components = []
    for c, (x, y) in enumerate(lattice.faces()):
        wx = bspline((seats[:, :1] - x[corner[0] : corner[0] + box[0]]) / lattice.step[0])
        wy = bspline((seats[:, 1:] - y[corner[1] : corner[1] + rows]) / lattice.step[1])
        components.append(jnp.einsum("mk,ki,kj->mij", values[:, c], wx, wy, optimize="optimal"))
    unit_area = float(np.prod(lattice.step))
    density = jnp.stack(components, axis=1) * (2 * np.pi / markers.shape[0] / unit_area)
    silent = jnp.einsum("mck,kc->m", values, normal)
    return Spreading(
        density, silent / jnp.linalg.norm(silent), corner, lattice.shape, lattice.cell_area
    )


def retraction(unit: Float[AnyArray, "nodes 2"]) -> Float[AnyArray, " nodes"]:
    """Cells by which to pull markers inward, on average, for a shear flow to vanish on the wall.

    A sheet of tangential force smeared by the spline B drives a ramp smeared likewise, whose
    B-mean at the sheet is not zero but shear times, on the lattice,
    R = (1/2 pi) int (1/k^2 - |B(k n)|^2 / lambda(k n)) dk, n the wall's normal, B the spline's
    Fourier transform, lambda the eigenvalue of the five-point Laplacian. R is 239/840 along the
    axes and 0.3058 along the diagonals; in between it follows cos of four times the angle.
    """
    axis, diagonal = 239 / 840, 0.3058
    return axis + (diagonal - axis) * 4 * (unit[:, 0] * unit[:, 1]) ** 2


def ripple(offset: Float[AnyArray, "..."]) -> Float[Array, "..."]:
    """What R along an axis adds to its mean where the sheet lies ``offset`` cells off a row.

    R = E|J - K| / 2 for rows J, K of the tangential velocity drawn with the spline's weights: from
    320/1152 on a row to 335/1152 between two, very nearly a cosine. Without it the drag wriggles
    as a flat side moves through the grid; along oblique walls it averages out.
    """
    return -5 / 768 * jnp.cos(2 * np.pi * offset)


def _seats(lattice, markers, normal):
    """The markers pulled inward, each by the retraction of its place in the grid."""
    step = np.array(lattice.step)
    speed = jnp.linalg.norm(normal, axis=1, keepdims=True)
    unit = normal / speed
    half_width = moments(markers)[0] / (np.pi * jnp.mean(speed))

    def pulled(cells):
        return markers - _retreat(cells, step, half_width) * unit

    mean = retraction(unit)[:, None]
    offset = pulled(mean) / step - 0.5  # faces of the tangential velocity: half a cell off 0
    return pulled(mean + jnp.sum(ripple(offset) * unit**2, axis=1, keepdims=True))


def _retreat(cells, step, half_width):
    """Distance by which to pull the markers inward, with what the fluid inside the body adds.

    The sheet drags the fluid inside along at -shear R h; in a body of half width l that fluid
    recirculates (Stokes flow in a slab or a disc: slope 3/l of its wall speed), which lowers the
    jump of the shear, so that R becomes R + 3 R^2 h / l to second order. l is 2 area / perimeter.
    """
    h = np.sqrt(np.prod(step))
    return h * (cells + 3 * cells**2 * h / half_width)


def bspline(r: Float[AnyArray, "..."]) -> Float[AnyArray, "..."]:
    """Cubic B-spline, support |r| < 2."""
    a = jnp.abs(r)
    near, far = jnp.maximum(1 - a, 0.0), jnp.maximum(2 - a, 0.0)
    return (far**3 - 4 * near**3) / 6
