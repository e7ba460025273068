"""A solved flow: loads on the body, what the solve cost, how far it can be trusted, its fields."""

import dataclasses
from typing import Literal

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.shape import Shape
from surrogate.errors import InvalidInput
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.loads.forces_3d import SkinLoads, skin_loads
from surrogate.flow.loads.surface import SURFACE_POINTS, Surface, surface_of
from surrogate.flow.solver.steady import FlowState


@dataclasses.dataclass(frozen=True)
class Solution:
    """The steady flow around a body at one Reynolds number; one that was not found has none.

    Coefficients are over U = D = rho = 1, per unit span: ``drag`` = 2 Fx and its parts, ``lift``,
    ``moment`` about the centroid, nose up; in space ``drag`` = 8 Fx / pi, the others are nought.
    ``gradient`` is of the drag in the family's parameters and in ``reynolds``, where it was asked
    for. ``status``, the estimated errors, the ``sufficient`` fidelity and ``extrapolated_drag`` are
    those of ``ErrorEstimate``.
    ``green_applications`` are those of this flow, ``seconds`` its wall time, both without gradient
    and estimate.
    """

    reynolds: float
    drag: float
    drag_pressure: float
    drag_friction: float
    lift: float
    moment: float
    status: Literal["accurate", "degraded", "unknown"]
    estimated_error: float | None
    estimated_lift_error: float | None
    sufficient: str | None
    extrapolated_drag: float | None
    green_applications: int
    newton_steps: int
    seconds: float
    gradient: dict[str, float] | None
    shape: Shape
    domain: Domain
    state: FlowState

    @property
    def markers(self) -> Markers:
        """The contour that was solved, in D, clockwise from the nose; in space the skin."""
        return self.shape.markers(self.domain.nodes)

    @property
    def velocity(self) -> Float[np.ndarray, "axes ..."]:
        """u, v, ... over U, the stream included, on the faces of ``domain.lattice.unfolded``."""
        whole = np.array(self.domain.lattice.unfold(self.state.velocity))
        whole[0] += 1.0
        return whole

    def skin_loads(
        self, points: Float[AnyArray, "points 3"], areas: Float[AnyArray, "points 3"]
    ) -> SkinLoads:
        """Cp and friction at points of the skin of a body in space, and their area vectors."""
        return skin_loads(self.domain, self.markers, self.state, self.reynolds, points, areas)

    def surface(self, points: int = SURFACE_POINTS) -> Surface:
        """Cp and Cf along the contour of a body in the plane.

        Raises:
          InvalidInput: the body is in space, where ``skin_loads`` are to be had.
        """
        if self.shape.dimension == 3:
            raise InvalidInput("surface: is of bodies in the plane; skin_loads of those in space")
        contour: AnyArray = self.shape.draw(points)
        return surface_of(self.domain, self.markers, self.state, contour, self.reynolds)
