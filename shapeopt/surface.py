"""What the stream does to a body's surface: pressure and friction along a solved contour."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body import family_markers
from surrogate.flow.domain import Domain
from surrogate.flow.drag import Solution, solve_with_continuation
from surrogate.flow.forces import friction_coefficient
from surrogate.flow.immersed import outward
from surrogate.flow.pressure import pressure, surface_pressure
from surrogate.scene import Scene
from surrogate.training.physics import scene_domain

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
        return float(-2 * np.pi * np.mean(self.cp * self._outward[:, 0]))

    @property
    def _outward(self):
        return np.asarray(outward(jnp.asarray(self.markers)))

    @property
    def station(self) -> Float[AnyArray, " nodes"]:
        """x / c: 0 at the nose, 1 at the tail."""
        x = self.markers[:, 0]
        return (x - x.min()) / np.ptp(x)


def surface_of(
    domain: Domain,
    markers: Float[AnyArray, "nodes 2"],
    solution: Solution,
    contour: Float[AnyArray, "points 2"],
    reynolds: float,
) -> Surface:
    """Loads on ``contour`` in a solved flow around the same body, given by ``markers``."""
    field = pressure(domain, markers, solution.state, reynolds)
    friction = friction_coefficient(
        domain, contour, solution.state.velocity, jnp.asarray(reynolds, float)
    )
    return Surface(
        np.asarray(contour), surface_pressure(domain, contour, field), np.asarray(friction)
    )


def solve_surface(scene: Scene, parameters: AnyArray, reynolds: float) -> Surface:
    """Solve a family body's flow on the scene's own grid and take its loads.

    Raises:
      NotConverged: the flow was not found.
    """
    domain, body = scene_domain(scene), jnp.asarray(parameters)
    markers = family_markers(body, domain.nodes)
    solution = solve_with_continuation(domain, markers, reynolds)
    return surface_of(domain, markers, solution, family_markers(body, SURFACE_POINTS), reynolds)
