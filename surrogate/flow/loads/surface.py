"""What the stream does to a body's surface: pressure and friction along a solved contour."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import outward
from surrogate.flow.loads.forces import friction_coefficient
from surrogate.flow.loads.pressure import pressure, surface_pressure
from surrogate.flow.solver.steady import FlowState

SURFACE_POINTS = 400


class Surface(NamedTuple):
    """Loads along a clockwise contour from the nose.

    Cp is zero far upstream; Cf is positive where friction points along the contour.
    """

    markers: Float[AnyArray, "nodes 2"]
    cp: Float[AnyArray, " nodes"]
    cf: Float[AnyArray, " nodes"]

    @property
    def pressure_drag(self) -> float:
        """Cd of the pressure alone."""
        normal = np.asarray(outward(jnp.asarray(self.markers)))
        return float(-2 * np.pi * np.mean(self.cp * normal[:, 0]))

    @property
    def station(self) -> Float[AnyArray, " nodes"]:
        """x / c: 0 at the nose, 1 at the tail."""
        x = self.markers[:, 0]
        return (x - x.min()) / np.ptp(x)


def surface_of(
    domain: Domain,
    markers: Float[AnyArray, "nodes 2"],
    state: FlowState,
    contour: Float[AnyArray, "points 2"],
    reynolds: float,
) -> Surface:
    """Loads on ``contour`` in a solved flow around the same body, given by ``markers``."""
    field = pressure(domain, jnp.asarray(markers), state, reynolds)
    normal = outward(jnp.asarray(contour))
    friction = friction_coefficient(domain, contour, state.velocity, jnp.asarray(reynolds, float))
    return Surface(
        np.asarray(contour), surface_pressure(domain, contour, normal, field), np.asarray(friction)
    )
