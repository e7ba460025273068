"""An independent check: jax-cfd marches the same immersed 2-D body in time, in a periodic box.

Of the steady solver only the traction modes and the slip law are used: no Green's function, no far
field, no Newton. The box is periodic; a sponge layer before its end brings the flow back to the
free stream, so rows of bodies H apart stand in the same stream (a tunnel of height H with slip
walls, for a symmetric flow). Each step brings the slip on the wall to that of the slip law; the
impulse that does so is the force.
"""

import dataclasses
import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax_cfd.base import (
    advection,
    diffusion,
    equations,
    grids,
    pressure,
    time_stepping,
)
from jaxtyping import Array, Float
from scipy.signal import find_peaks

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import box_around
from surrogate.flow.grid.immersed import Spreading, spread_modes
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes_2d import Modes2D
from surrogate.flow.grid.wall_2d import wall_2d
from surrogate.flow.loads import drag, lift
from surrogate.flow.solver.steady import NULL_MODE_COMPLIANCE

MIDPOINT = time_stepping.midpoint_rk2
# Differences of extremes of the lift from which the rate of its growth is known; smaller ones may
# be of rounding.
EXTREMES, LEAST_SWING = 8, 1e-7


@dataclasses.dataclass(frozen=True)
class Box:
    """The size and resolution of a march, in D and D / U; its last ``sponge`` D damp the wake."""

    cells: int = 12
    upstream: float = 8.0
    downstream: float = 16.0
    height: float = 16.0
    sponge: float = 4.0
    harmonics: int = 7
    step: float = 0.02

    @property
    def lattice(self) -> Lattice:
        """The periodic lattice of the box."""
        columns = round((self.upstream + self.downstream) * self.cells)
        rows = 2 * round(self.height * self.cells / 2)
        step = (1 / self.cells, self.height / rows)
        return Lattice((columns, rows), step, round(self.upstream * self.cells), periodic=True)

    @property
    def modes(self) -> Modes2D:
        """The traction modes of a body of any contour."""
        return Modes2D(self.harmonics, symmetric=False)


class Marcher(NamedTuple):
    """The arrays that all steps of a march share: the body, and the response to its impulses.

    Attributes:
      markers: of the body.
      body: the spread modes.
      reynolds: U D / nu, of the flow and of the slip law in ``inverse``.
      impulse: velocity that a unit impulse of every mode causes.
      inverse: matrix from a slip to the impulses that bring it to the slip law, but for their sign.
    """

    markers: Float[Array, "nodes 2"]
    body: Spreading
    reynolds: Float[Array, ""]
    impulse: Float[Array, "modes 2 nx ny"]
    inverse: Float[Array, "modes modes"]


class ForceHistory(NamedTuple):
    """The force coefficients Cd and Cl at every step in time."""

    drag: Float[Array, " steps"]
    lift: Float[Array, " steps"]


def start(box: Box, kick: float = 0.0) -> Float[Array, "2 nx ny"]:
    """Return the free stream as initial velocity, with a vortex that breaks the symmetry.

    ``kick`` is the largest velocity across the stream that is added, over U, before its divergence
    is removed.
    """
    velocity = np.zeros((2, *box.lattice.shape))
    velocity[0] = 1.0
    x, y = box.lattice.faces()[1]
    velocity[1] += kick * np.outer(np.exp(-((x - 1.5) ** 2)), np.exp(-(y**2)))
    return _project(box, jnp.asarray(velocity), flux=1.0)


def make_marcher(
    box: Box, markers: Float[AnyArray, "nodes 2"], reynolds: Float[AnyArray, ""] | float
) -> Marcher:
    """Return the arrays that all steps of a march share, for a body with these markers.

    The impulse of every mode is projected once; their slips make the matrix that brings the slip to
    that of the slip law, which is taken at the end of the step (implicit in time).

    Args:
      box: size and resolution.
      markers: of the body, in D.
      reynolds: U D / nu.
    """
    extent = 2 * np.abs(np.asarray(markers)).max(axis=0)
    wall = wall_2d(box.lattice, box.modes, jnp.asarray(markers), reynolds)
    body = spread_modes(box.lattice, box_around(tuple(extent.tolist()), box.cells), wall)
    impulse = jax.lax.map(lambda mode: _project(box, body.spread(mode)), jnp.eye(box.modes.count))
    matrix = jax.vmap(body.slip)(impulse).T
    null = NULL_MODE_COMPLIANCE * jnp.trace(matrix) / box.modes.count
    null = null * jnp.outer(body.null_mode, body.null_mode)
    inverse = jnp.linalg.inv(matrix + body.compliance / box.step + null)
    return Marcher(jnp.asarray(markers), body, jnp.asarray(reynolds), impulse, inverse)


@functools.partial(jax.jit, static_argnames=("box", "steps"))
def march(
    box: Box,
    marcher: Marcher,
    velocity: Float[AnyArray, "2 nx ny"],
    steps: int,
) -> tuple[Float[Array, "2 nx ny"], ForceHistory]:
    """Advance a flow by ``steps`` of midpoint Runge-Kutta, and return it with its force history.

    Args:
      box: size and resolution.
      marcher: from ``make_marcher`` for this box.
      velocity: on the faces, the stream included, over U.
      steps: number of steps, each of ``box.step`` D / U.
    """
    advance = _navier_stokes(box, marcher.reynolds)

    def one(velocity, _):
        velocity = _hold_flux(_arrays(advance(box.lattice.variables(velocity))), 1.0)
        amplitude = -marcher.inverse @ marcher.body.slip(velocity)
        velocity += jnp.tensordot(amplitude, marcher.impulse, axes=1)
        at = box.modes, amplitude / box.step, marcher.markers
        return velocity, ForceHistory(drag(*at), lift(*at))

    return jax.lax.scan(one, velocity, length=steps)


def strouhal(lift: Float[AnyArray, " steps"], step: float) -> float | None:
    """Return the Strouhal number f D / U from the lift's interpolated upward zero crossings.

    None with fewer than three crossings. ``step`` is the time between the values, in D / U.
    """
    lift = np.asarray(lift) - np.mean(lift)
    index = np.flatnonzero((lift[:-1] < 0) & (lift[1:] >= 0))
    if len(index) < 3:
        return None
    crossing = index + lift[index] / (lift[index] - lift[index + 1])
    return float((len(crossing) - 1) / ((crossing[-1] - crossing[0]) * step))


def growth_rate(lift: Float[AnyArray, " steps"], step: float) -> float | None:
    """Return the rate in U / D at which the lift's oscillation grows; None with too few periods.

    It is the slope of the logarithm of the differences between one extreme and the next in the
    later half of the time, of which there must be ``EXTREMES`` above ``LEAST_SWING``. ``step`` is
    the time between the values, in D / U.
    """
    late = np.asarray(lift)[len(lift) // 2 :]
    extremes = np.sort(np.concatenate([find_peaks(late)[0], find_peaks(-late)[0]]))
    swings, middles = np.abs(np.diff(late[extremes])), (extremes[1:] + extremes[:-1]) / 2
    swings, middles = swings[swings > LEAST_SWING], middles[swings > LEAST_SWING]
    if len(swings) < EXTREMES:
        return None
    return float(np.polyfit(step * middles, np.log(swings), 1)[0])


def _navier_stokes(box, reynolds):
    """Return jax-cfd's explicit Navier-Stokes step with the sponge layer as forcing."""
    lattice = box.lattice
    stream = (1.0, 0.0)
    sponges = [jnp.asarray(_sponge(box, x))[:, None] for x, _ in lattice.faces()]

    def relax(velocity):
        return tuple(
            grids.GridArray(-strength * (u.data - free), u.offset, u.grid)
            for strength, u, free in zip(sponges, velocity, stream, strict=True)
        )

    return equations.semi_implicit_navier_stokes(
        density=1.0,
        viscosity=1 / reynolds,
        dt=box.step,
        grid=lattice.grid,
        convect=advection.convect_linear,
        diffuse=diffusion.diffuse,
        pressure_solve=pressure.solve_fast_diag,
        forcing=relax,
        time_stepper=MIDPOINT,
    )


def _sponge(box, x):
    """Return the relaxation rate: a smooth bump over the last ``sponge`` D of the box."""
    s = (x - (box.downstream - box.sponge)) / box.sponge
    inside = (s > 0) & (s < 1)
    return np.where(inside, 4.0 * np.sin(np.pi * np.clip(s, 0, 1)) ** 2, 0.0)


def _project(box, velocity, flux=0.0):
    """Return the divergence-free part; a uniform pressure gradient holds the mean of u."""
    return _hold_flux(_arrays(pressure.projection(box.lattice.variables(velocity))), flux)


def _hold_flux(velocity, flux):
    return velocity.at[0].add(flux - jnp.mean(velocity[0]))


def _arrays(variables):
    return jnp.stack([variable.data for variable in variables])
