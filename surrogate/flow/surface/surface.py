"""Pressure and friction along the contour of a solved 2-D body."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.incidence import rotate
from surrogate.flow.grid.domain_2d import Domain2D
from surrogate.flow.grid.wall_2d import outward
from surrogate.flow.surface.forces_2d import friction_coefficient
from surrogate.flow.surface.pressure import surface_pressure

SURFACE_POINTS = 400


class Surface(NamedTuple):
    """The pressure and friction coefficients along a clockwise contour from the nose.

    Cp is zero far upstream; Cf is positive where the friction points along the contour. The markers
    are those of the body as it lies, at ``incidence`` in degrees, nose up.
    """

    markers: Float[AnyArray, "nodes 2"]
    cp: Float[AnyArray, " nodes"]
    cf: Float[AnyArray, " nodes"]
    incidence: float = 0.0

    @property
    def pressure_drag(self) -> float:
        """The drag coefficient by the pressure alone."""
        normal = np.asarray(outward(jnp.asarray(self.markers)))
        return float(-2 * np.pi * np.mean(self.cp * normal[:, 0]))

    @property
    def station(self) -> Float[AnyArray, " nodes"]:
        """The x / c of the nodes along the chord: 0 at the nose, 1 at the tail."""
        x = rotate(np.asarray(self.markers), -self.incidence)[:, 0]
        return (x - x.min()) / np.ptp(x)


def surface_of(
    domain: Domain2D,
    velocity: Float[AnyArray, "2 nx ny"],
    p: Float[np.ndarray, "..."],
    contour: Float[AnyArray, "points 2"],
    reynolds: float,
) -> Surface:
    """Return the pressure and friction along a contour of a solved 2-D body.

    Args:
      domain: the discrete problem.
      velocity: of the flow's state, on the domain's faces.
      p: pressure over rho U^2 in the cells of the whole lattice.
      contour: points at equidistant t, where the loads are wanted.
      reynolds: U D / nu.
    """
    normal = outward(jnp.asarray(contour))
    friction = friction_coefficient(domain, contour, velocity, jnp.asarray(reynolds, float))
    return Surface(
        np.asarray(contour), surface_pressure(domain, contour, normal, p), np.asarray(friction)
    )
