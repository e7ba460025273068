"""A solved flow: force coefficients, work, estimated error and fields."""

import dataclasses
from typing import Literal

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.shape import Shape
from surrogate.errors import InvalidInput
from surrogate.flow.check.error_estimate import accuracy_text
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.surface.forces_3d import SkinLoads, skin_loads
from surrogate.flow.surface.surface import SURFACE_POINTS, Surface, surface_of


@dataclasses.dataclass(frozen=True)
class Solution:
    """The steady flow past one body at one Reynolds number.

    Coefficients are over U = D = rho = 1: 2 F and 2 M per unit span in 2-D, 8 F / pi in 3-D.

    Attributes:
      reynolds: U D / nu.
      drag: Cd; ``drag_pressure`` and ``drag_friction`` are its parts.
      lift: Cl, positive along y; 0 in 3-D.
      moment: Cm about the centroid, positive nose up; 0 in 3-D.
      status: "accurate" where Cd is expected to meet the tolerance, else "degraded", or "unknown"
        without an estimate; ``accuracy`` says why.
      expected_error: expected relative error of Cd; None where there is no estimate.
      estimated_error: relative bound of the error of Cd, which 95 % of the errors are within.
      estimated_lift_error: bound of the error of Cl itself.
      sufficient: name of a fidelity that should meet the tolerance that this one does not.
      extrapolated_drag: Cd extrapolated from two grids, where both are fine enough.
      tolerance: relative error of Cd that the scene's fidelity is made for.
      green_applications: convolutions with G of this flow, without gradient and estimate.
      newton_steps: Newton steps of the last solve.
      seconds: wall time of this flow, without gradient and estimate.
      gradient: dCd by the family's parameters and ``reynolds``, where asked for.
      shape: the body.
      domain: the discretisation.
      state: velocity and traction modes.
    """

    reynolds: float
    drag: float
    drag_pressure: float
    drag_friction: float
    lift: float
    moment: float
    status: Literal["accurate", "degraded", "unknown"]
    expected_error: float | None
    estimated_error: float | None
    estimated_lift_error: float | None
    sufficient: str | None
    extrapolated_drag: float | None
    tolerance: float
    green_applications: int
    newton_steps: int
    seconds: float
    gradient: dict[str, float] | None
    shape: Shape
    domain: Domain
    state: FlowState

    @property
    def accuracy(self) -> str:
        """Whether Cd meets the tolerance, in words: "meets 0.4 % (expected 0.3 %, bound ...)"."""
        errors = self.expected_error, self.estimated_error
        return accuracy_text(self.status, *errors, self.tolerance, self.sufficient)

    @property
    def markers(self) -> Markers:
        """Surface markers in D: the contour clockwise from the nose, or a quarter of the skin."""
        return self.shape.markers(self.domain.nodes)

    @property
    def velocity(self) -> Float[np.ndarray, "axes ..."]:
        """Velocity over U, the stream included, on the faces of ``domain.lattice.unfolded``."""
        whole = np.array(self.domain.lattice.unfold(self.state.velocity))
        whole[0] += 1.0
        return whole

    def skin_loads(
        self, points: Float[AnyArray, "points 3"], areas: Float[AnyArray, "points 3"]
    ) -> SkinLoads:
        """Return Cp and friction at points of a 3-D body's skin, given with their area vectors."""
        return skin_loads(self.domain, self.markers, self.state, self.reynolds, points, areas)

    @property
    def chord(self) -> float:
        """The body's length from nose to tail at zero incidence, in D."""
        return self.shape.chord

    @property
    def chord_reynolds(self) -> float:
        """U c / nu, by the chord c."""
        return self.reynolds * self.chord

    def surface(self, points: int = SURFACE_POINTS) -> Surface:
        """Return Cp and Cf along the contour of a 2-D body.

        Raises:
          InvalidInput: the body is 3-D, where ``skin_loads`` has them.
        """
        if self.shape.dimension == 3:
            raise InvalidInput("surface: is for 2-D bodies; skin_loads is for 3-D ones")
        contour: AnyArray = self.shape.draw(points)
        return surface_of(self.domain, self.markers, self.state, contour, self.reynolds)
