"""The body in the grid: traction modes spread by cubic B-splines, slip tested by the same modes."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.measures import moments
from surrogate.body.skin import QUARTERS, Skin
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes import Modes, SpaceModes

RING = 6  # cells along the stream that hold a ring's splines: four, and what it is pulled askew
THIN = 40.0  # Re about which a boundary layer in space thins to few cells
PULLED = 0.8  # share of the retraction that takes over in space far beyond
THICK = 12.0  # of its second order in space, per D

Markers = Float[AnyArray, "nodes 2"] | Skin


class Spreading(eqx.Module):
    """Force densities B of all modes on a box of the window around the body.

    ``spread`` is the map from mode amplitudes to a force density on the grid, ``slip`` its
    transpose (times the cell volume): the mode-weighted mean of a velocity on the contour.
    ``silent`` is the unit vector of uniform pressure, the traction that moves nothing.
    ``slip_law`` is the slip that the grid shows of each mode where the wall has none.
    """

    density: Float[AnyArray, "modes axes ..."]
    silent: Float[AnyArray, " modes"]
    slip_law: Float[AnyArray, "#modes #modes"]
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

    In space, at low ``reynolds``, they stay on the wall and a slip law holds there instead.
    """
    points, normal = (markers, outward(markers)) if isinstance(modes, Modes) else markers
    speed = jnp.linalg.norm(normal, axis=1, keepdims=True)
    lawful = _lawful(reynolds) if lattice.dimension == 3 else 0.0
    unit, second = normal / speed, _second_order(points, speed)
    seats, retracted = _seats(lattice, points, unit, second, 1 - lawful)
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
    thickness = lawful * reynolds * lattice.step[0] * (retracted / speed)[:, 0]
    return Spreading(
        density,
        silent / jnp.linalg.norm(silent),
        _slip_law(values, unit, weights * thickness),
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


def offset_correction(offset: Float[AnyArray, "..."]) -> Float[Array, "..."]:
    """What R along an axis adds to its mean where the sheet lies ``offset`` cells off a row.

    R = E|J - K| / 2 for rows J, K of the tangential velocity drawn with the spline's weights: from
    320/1152 on a row to 335/1152 between two, very nearly a cosine. Without it the drag wriggles
    as a flat side moves through the grid; along oblique walls it averages out.
    """
    return -5 / 768 * jnp.cos(2 * np.pi * offset)


def _seats(lattice, points, unit, second, share):
    """The markers pulled inward, by a share of the retraction of their places, and that in h."""
    step = np.array(lattice.step)
    h = np.prod(step) ** (1 / step.size)

    def pulled(cells):
        return points - share * h * (cells + cells**2 * h * second) * unit

    mean = retraction(unit)[:, None]
    offset = pulled(mean) / step - 0.5  # faces of the tangential velocity: half a cell off 0
    cells = mean + jnp.sum(offset_correction(offset) * unit**2, axis=1, keepdims=True)
    return pulled(cells), cells


def _slip_law(values, unit, weights):
    """Sum over markers of mode times mode, both along the wall; none in the plane.

    A sheet of traction t on the wall itself drags the fluid there along as if the wall were R h
    further in: the B-mean of a true flow's velocity, which is no slip, is -R h Re t. Against
    retraction it lets the fluid inside the body rest and the wall stay tight, so that no
    second-order term is left of the Stokes flow around a sphere.
    """
    if values.shape[1] == 2:
        return jnp.zeros((1, 1))
    along = values - jnp.sum(values * unit.T, axis=1, keepdims=True) * unit.T
    return QUARTERS * jnp.einsum("mck,nck,k->mn", along, along, weights)


def _lawful(reynolds):
    """Share of the slip law in space, the rest being retraction.

    Where a boundary layer has few cells, the smeared sheet's own inertia counts. It takes drag off
    bluff bodies under the slip law; retraction and its second order together take some off as
    well. A mixture, whose error is not the mean of theirs, leaves little. Which one, and from which
    Re, was measured on spheroids of aspect 0.5 to 4 and one other body at Re 22 to 100.
    """
    return 1 - PULLED * thinned(reynolds)


def thinned(reynolds: Any) -> Any:
    """How far a boundary layer in space has thinned to few cells: 0 at low Re, 1 at high."""
    return reynolds**4 / (reynolds**4 + THIN**4)


def _second_order(points, speed):
    """What R^2 h^2 is multiplied by, per D, to make the retraction second order.

    In the plane, what the fluid inside the body adds: the sheet drags it along at -shear R h; in
    a body of half width l it recirculates (Stokes flow in a slab or a disc: slope 3/l of its wall
    speed), which lowers the jump of the shear. l is 2 area / perimeter. In space, where markers
    are retracted beyond Re 20 or so, it was measured there; Hill's vortex would be 4/l.
    """
    if points.shape[1] == 2:
        return 3 * np.pi * jnp.mean(speed) / moments(points)[0]
    return THICK


def bspline(r: Float[AnyArray, "..."]) -> Float[AnyArray, "..."]:
    """Cubic B-spline, support |r| < 2."""
    a = jnp.abs(r)
    near, far = jnp.maximum(1 - a, 0.0), jnp.maximum(2 - a, 0.0)
    return (far**3 - 4 * near**3) / 6
