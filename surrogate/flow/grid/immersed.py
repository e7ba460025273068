"""The body in the grid: traction modes spread by cubic B-splines, slip tested by the same modes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.measures import moments
from surrogate.body.solid import Skin
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes import Modes, SpaceModes

RING = 6  # cells along the stream that hold a ring's splines: four, and what it is pulled askew
THINNING = 0.052  # of the second order in space, per Re
SHARP = 8  # power of a mean that is nearly a maximum

Markers = Float[AnyArray, "nodes 2"] | Skin


class Spreading(eqx.Module):
    """Force densities B of all modes on a box of the window around the body.

    ``spread`` is the map from mode amplitudes to a force density on the grid, ``slip`` its
    transpose (times the cell volume): the mode-weighted mean of a velocity on the contour.
    ``silent`` is the unit vector of uniform pressure, the traction that moves nothing.
    """

    density: Float[AnyArray, "modes axes ..."]
    silent: Float[AnyArray, " modes"]
    corner: tuple[int, ...] = eqx.field(static=True)
    shape: tuple[int, ...] = eqx.field(static=True)
    volume: float = eqx.field(static=True)

    @property
    def _box(self):
        sides = zip(self.corner, self.density.shape[2:], strict=True)
        return (slice(None), *(slice(start, start + side) for start, side in sides))

    def spread(self, amplitude: Float[AnyArray, " modes"]) -> Float[AnyArray, "axes ..."]:
        local = jnp.tensordot(amplitude, self.density, axes=1)
        return jnp.zeros((len(self.shape), *self.shape), local.dtype).at[self._box].set(local)

    def slip(self, velocity: Float[AnyArray, "axes ..."]) -> Float[AnyArray, " modes"]:
        axes = velocity.ndim
        return self.volume * jnp.tensordot(self.density, velocity[self._box], axes=axes)

    def slip_of_stream(self) -> Float[AnyArray, " modes"]:
        """Slip of the undisturbed stream along x."""
        along = self.density[:, 0]
        return self.volume * jnp.sum(along, axis=tuple(range(1, along.ndim)))


def outward(markers: Float[AnyArray, "nodes 2"]) -> Float[AnyArray, "nodes 2"]:
    """Outward normal times ds/dt of a clockwise contour given at equidistant t."""
    nodes = markers.shape[0]
    wave = np.fft.fftfreq(nodes, 1 / nodes)
    wave[nodes // 2] = 0.0
    tangent = jnp.fft.ifft(1j * wave[:, None] * jnp.fft.fft(markers, axis=0), axis=0).real
    return jnp.stack([-tangent[:, 1], tangent[:, 0]], axis=1)


def spread_modes(
    lattice: Lattice,
    modes: Modes | SpaceModes,
    box: tuple[int, ...],
    markers: Markers,
    reynolds: Float[AnyArray, ""] | float = 0.0,
) -> Spreading:
    """Spread all modes from a body's surface, the markers pulled inward a little.

    How far depends on ``reynolds`` in space alone.
    """
    points, normal = (markers, outward(markers)) if isinstance(modes, Modes) else markers
    speed = jnp.linalg.norm(normal, axis=1, keepdims=True)
    second = _second_order(points, speed, reynolds)
    seats = _seats(lattice, points, normal / speed, second)
    corner, sides = [lattice.inlet - box[0] // 2], [box[0]]
    for cells, side in zip(lattice.shape[1:], box[1:], strict=True):
        below = 0 if lattice.symmetric else side // 2  # of the box under the centre line
        corner.append((0 if lattice.symmetric else cells // 2) - below)
        sides.append(below + side // 2)
    nodes = len(points) if isinstance(modes, Modes) else markers.nodes
    values, weights = modes.values(nodes), modes.weights(nodes)
    components = []
    for own, face in enumerate(lattice.faces()):
        reach = [
            _splines(seats[:, axis], x[start : start + side], axis, own, lattice)
            for axis, (x, start, side) in enumerate(zip(face, corner, sides, strict=True))
        ]
        components.append(_scattered(values[:, own] * weights, reach, nodes))
    density = jnp.stack(components, axis=1) / float(np.prod(lattice.step))
    silent = jnp.einsum("mck,kc->m", values * weights, normal)
    return Spreading(
        density,
        silent / jnp.linalg.norm(silent),
        tuple(corner),
        lattice.shape,
        lattice.cell_volume,
    )


def _splines(seats, faces, axis, own, lattice):
    """B-splines of all markers along one axis; in space those of their mirror images as well."""
    step = lattice.step[axis]
    weights = bspline((seats[:, None] - faces) / step)
    if axis == 0 or lattice.dimension == 2:
        return weights
    return weights + (-1 if axis == own else 1) * bspline((seats[:, None] + faces) / step)


def _scattered(values, reach, nodes):
    """Sum over markers of the values of every mode times the product of the splines."""
    if len(reach) == 2:
        return jnp.einsum("mk,ki,kj->mij", values, *reach, optimize="optimal")

    @jax.checkpoint
    def ring(total, parts):
        values, x, y, z = parts
        start = jnp.argmax(jnp.any(x != 0, axis=0))  # a ring reaches few cells along the stream
        x = jax.lax.dynamic_slice_in_dim(x, start, RING, axis=1)
        spread = x[:, :, None, None] * (y[:, :, None] * z[:, None])[:, None]
        here = jax.lax.dynamic_slice_in_dim(total, start, RING, axis=1)
        here = here + jnp.tensordot(values.T, spread, axes=1)
        return jax.lax.dynamic_update_slice_in_dim(total, here, start, axis=1), None

    # all markers' boxes at once would take gigabytes
    rings = [part.reshape(*nodes, -1) for part in (jnp.asarray(values.T), *reach)]
    none = jnp.zeros((len(values), *(part.shape[1] for part in reach)))
    return jax.lax.scan(ring, none, rings)[0]


def retraction(unit: Float[AnyArray, "nodes axes"]) -> Float[AnyArray, " nodes"]:
    """Cells by which to pull markers inward, on average, for a shear flow to vanish on the wall.

    A sheet of tangential force smeared by the spline B drives a ramp smeared likewise, whose
    B-mean at the sheet is not zero but shear times, on the lattice,
    R = (1/2 pi) int (1/k^2 - |B(k n)|^2 / lambda(k n)) dk, n the wall's normal, B the spline's
    Fourier transform, lambda the eigenvalue of the lattice Laplacian. R is 239/840 along the
    axes, 0.3058 along the diagonals of a square and 0.3126 along those of a cube.
    """
    axis, diagonal, cube = 239 / 840, 0.3058, 0.3126
    squares = unit**2
    oblique = 2 * (1 - jnp.sum(squares**2, axis=1))  # 1 along the diagonals of a square
    mean = axis + (diagonal - axis) * oblique
    if unit.shape[1] == 2:
        return mean
    return mean + 27 * (cube - axis - 4 / 3 * (diagonal - axis)) * jnp.prod(squares, axis=1)


def ripple(offset: Float[AnyArray, "..."]) -> Float[Array, "..."]:
    """What R along an axis adds to its mean where the sheet lies ``offset`` cells off a row.

    R = E|J - K| / 2 for rows J, K of the tangential velocity drawn with the spline's weights: from
    320/1152 on a row to 335/1152 between two, very nearly a cosine. Without it the drag wriggles
    as a flat side moves through the grid; along oblique walls it averages out.
    """
    return -5 / 768 * jnp.cos(2 * np.pi * offset)


def _seats(lattice, points, unit, second):
    """The markers pulled inward, each by the retraction of its place in the grid."""
    step = np.array(lattice.step)

    def pulled(cells):
        h = np.prod(step) ** (1 / step.size)
        return points - h * (cells + cells**2 * h * second) * unit

    mean = retraction(unit)[:, None]
    offset = pulled(mean) / step - 0.5  # faces of the tangential velocity: half a cell off 0
    return pulled(mean + jnp.sum(ripple(offset) * unit**2, axis=1, keepdims=True))


def _second_order(points, speed, reynolds):
    """What R^2 h^2 is multiplied by, per D, to make the retraction second order.

    In the plane, what the fluid inside the body adds: the sheet drags it along at -shear R h; in
    a body of half width l it recirculates (Stokes flow in a slab or a disc: slope 3/l of its wall
    speed), which lowers the jump of the shear. l is 2 area / perimeter.

    In space three terms, for the Stokes flow around a sphere of radius l: the fluid inside
    (Hill's vortex) 4/l, the curved profile of the flow outside 3/2l, and the flow through the
    sheet that the retraction stops 1/2l; 6/l together. 1/l is that along or the mean of those
    across the stream, whichever is greater, which fits Oberbeck's ellipsoids. With Re the
    boundary layer thins to few cells and the lattice takes drag off bluff bodies, which a lesser
    retraction gives back: how much was measured on spheroids of aspect 0.5 to 4 up to Re 100.
    """
    if points.shape[1] == 2:
        return 3 * np.pi * jnp.mean(speed) / moments(points)[0]
    half = jnp.max(jnp.abs(points), axis=0)
    slenderness = half[0] / jnp.sqrt(half[1] * half[2])
    along, across = 1 / half[0], (1 / half[1] + 1 / half[2]) / 2
    sharpest = ((along**SHARP + across**SHARP) / 2) ** (1 / SHARP)  # a maximum without a kink
    return (6 - THINNING * reynolds / (1 + slenderness**4 / 5)) * sharpest


def bspline(r: Float[AnyArray, "..."]) -> Float[AnyArray, "..."]:
    """Cubic B-spline, support |r| < 2."""
    a = jnp.abs(r)
    near, far = jnp.maximum(1 - a, 0.0), jnp.maximum(2 - a, 0.0)
    return (far**3 - 4 * near**3) / 6
