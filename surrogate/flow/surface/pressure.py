"""Pressure of a solved flow, recovered from the momentum equation, on the grid and on the surface.

The traction modes carry the drag but split it badly on slender bodies, so the surface pressure is
extrapolated from the flow outside of the smeared layer.
"""

import functools
import math
from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Float
from scipy.ndimage import map_coordinates
from scipy.special import kve

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.surface.probes import PRESSURE_PROBES, extrapolation_weights

IMAGES = 2  # of a body on either side that are mirrored in a tunnel's walls as they are
DECAYED = 30.0  # exponent by which more distant images no longer count


def pressure(
    domain: Domain, markers: Markers, state: FlowState, reynolds: float
) -> Float[np.ndarray, "..."]:
    """Return p / rho U^2 in the cells of the whole domain, zero far upstream.

    grad p is the body force minus the momentum equation's terms in the velocity. It has no curl on
    the grid, except for the interpolated far field, so any path of integration will do. The path
    starts in the middle of the inflow side, where the total head is the stream's but for
    ``head_loss``, which matters at low Re.

    Args:
      domain: the discrete problem.
      markers: of the body.
      state: of the flow.
      reynolds: U D / nu.
    """
    lattice = domain.lattice.unfolded
    force = np.asarray(_body_force(domain, markers, state.amplitude, reynolds))
    velocity = np.asarray(domain.lattice.unfold(state.velocity))
    gradient = force - momentum_defect(lattice, velocity, reynolds)
    margin = round(1.5 / lattice.step[0])  # cells at the edge, where convection is blended out
    middle = (margin, *(count // 2 for count in lattice.shape[1:]))
    field = np.zeros(lattice.shape)
    for axis, step in enumerate(lattice.step):  # along the middles of the axes before this one
        along = np.cumsum(gradient[axis][middle[:axis]], axis=0) * step
        along = np.concatenate([np.zeros_like(along[:1]), along[:-1]])
        field += along - along[middle[axis]]
    entry = tuple(slice(index - 1, index + 1) for index in middle)
    change = [component[entry].mean() for component in velocity]
    ends = zip(lattice.grid.domain, middle, lattice.step, strict=True)
    point = [low + index * step for (low, _), index, step in ends]
    forces = force + _lamb_vector(lattice, velocity)
    loss = head_loss(lattice, forces, point, reynolds, domain.height)
    return field - field[entry].mean() - change[0] - np.square(change).sum() / 2 - loss


@functools.partial(jax.jit, static_argnums=0)
def _body_force(domain, markers, amplitude, reynolds):
    """Return the force density of the body on the faces of the whole domain."""
    return domain.lattice.unfold(domain.spread_body(markers, reynolds).spread(amplitude))


def _lamb_vector(lattice, velocity):
    """Return u' x omega on the faces, -div u' u' + grad u'^2 / 2; zero where w is below 1."""
    middle = [(part + np.roll(part, 1, axis)) / 2 for axis, part in enumerate(velocity)]
    energy = np.square(middle).sum(axis=0) / 2
    slope = [(np.roll(energy, -1, k) - energy) / step for k, step in enumerate(lattice.step)]
    weight = lattice.cutoff()
    return np.where(weight == 1, lattice.convect(weight * velocity) + np.stack(slope), 0.0)


def head_loss(
    lattice: Lattice,
    forces: Float[np.ndarray, "axes ..."],
    point: Sequence[float],
    reynolds: float,
    height: float | None,
) -> float:
    """Return by how much the total head p + u^2 / 2 at a point is below the stream's.

    With forces f, and the Lamb vector u' x omega of the perturbation among them, the momentum
    equation gives dH/dx - nu Lap H = f_x - nu div f for the head H, which is solved by the integral
    of ``_head_of_unit_force``. In a tunnel the walls add mirror images of the forces; those more
    than ``IMAGES`` heights away are each taken for one force at a centre.

    Args:
      lattice: whole grid.
      forces: on its faces, over rho U^2 / D.
      point: at which the head is wanted, not on a face.
      reynolds: U D / nu.
      height: distance of the tunnel's walls, at y = +- height / 2; None for an unbounded stream.
    """
    last = 0 if height is None else math.floor(2 * DECAYED / (reynolds * height) + 0.5)
    near, span, head = min(last, IMAGES), height or 0.0, 0.0
    for axis, (face, force) in enumerate(zip(lattice.faces(), forces, strict=True)):
        for image in range(-near, near + 1):
            side = -1 if image % 2 else 1  # a wall turns y into height - y
            places = face[0], image * span + side * face[1], *face[2:]
            away = [end - place for end, place in zip(point, places, strict=True)]
            away = np.meshgrid(*away, indexing="ij", sparse=True)
            own = np.sum(_head_of_unit_force(away, axis, reynolds) * force)
            head += side * own if axis == 1 else own
    if last > IMAGES:
        total, beyond = np.sum(forces[0]), np.arange(IMAGES + 1, last + 1)
        # The moments of x f_x and y f_y count with opposite signs, as E_yy is -E_xx far away.
        (x, _), (_, y) = lattice.faces()
        centre = (np.sum(x @ forces[0]) - np.sum(forces[1] @ y)) / total
        rows = point[1] - height * np.concatenate([-beyond, beyond])
        away = [np.full_like(rows, point[0] - centre), rows]
        head += np.sum(_head_of_unit_force(away, 0, reynolds)) * total
    return -float(head * np.prod(lattice.step))


def _head_of_unit_force(away, axis, reynolds):
    """Return the head due to a unit force along an axis, at a vector ``away`` from it.

    It is Re E in the direction of the stream, less dE / dx_axis, with k = Re / 2 and
    E = exp(k x) K0(k r) / (2 pi) in 2-D, exp(k (x - r)) / (4 pi r) in 3-D. Upstream it falls off as
    exp(-Re r).
    """
    k, distance = reynolds / 2, np.sqrt(sum(side**2 for side in away))
    decay = np.exp(k * (away[0] - distance))
    if len(away) == 2:
        green = decay * kve(0, k * distance) / (2 * np.pi)
        radial = -k * decay * kve(1, k * distance) / (2 * np.pi)
    else:
        green = decay / (4 * np.pi * distance)
        radial = -(k + 1 / distance) * green
    across = -radial * away[axis] / distance
    return across + (reynolds - k) * green if axis == 0 else across


def surface_pressure(
    domain: Domain,
    points: Float[AnyArray, "nodes axes"],
    normal: Float[AnyArray, "nodes axes"],
    field: Float[np.ndarray, "..."],
) -> Float[np.ndarray, " nodes"]:
    """Return Cp at points of a surface, extrapolated from the pressure some cells off the wall.

    Args:
      domain: the discrete problem.
      points: of the surface, in D.
      normal: outward normals there, of any length.
      field: pressure over rho U^2 in the cells, as ``pressure`` returns it.
    """
    lattice, h = domain.lattice.unfolded, domain.lattice.step[0]
    points, normal = np.asarray(points), np.asarray(normal)
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    origin = np.array([lattice.inlet, *(count / 2 for count in lattice.shape[1:])]) - 0.5
    probed = [
        map_coordinates(
            field, ((points + k * h * unit) / lattice.step + origin).T, order=3, mode="nearest"
        )
        for k in PRESSURE_PROBES
    ]
    return 2 * extrapolation_weights(PRESSURE_PROBES) @ np.array(probed)


def momentum_defect(
    lattice: Lattice, velocity: Float[AnyArray, "axes ..."], reynolds: float
) -> Float[np.ndarray, "axes ..."]:
    """Return f - grad p of the perturbation u': the momentum equation's terms in the velocity.

    These are D0x u' - nu Lap u' + div(w^2 u' u') by the discrete operators on the whole domain.
    """
    u = np.asarray(velocity)

    def shift(axis, cells):
        return np.roll(u, -cells, axis=axis + 1)

    stream = (shift(0, 1) - shift(0, -1)) / (2 * lattice.step[0])
    friction = sum(
        (shift(axis, 1) - 2 * u + shift(axis, -1)) / step**2
        for axis, step in enumerate(lattice.step)
    )
    convection = np.asarray(lattice.convect(lattice.cutoff() * u))
    return stream - friction / reynolds - convection
