"""Force coefficients of a solved flow, with the parts of drag by pressure and by friction."""

from collections.abc import Callable

from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.domain_2d import Domain2D
from surrogate.flow.grid.domain_3d import Domain3D
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.loads import Coefficients
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.surface.forces_2d import coefficients_2d
from surrogate.flow.surface.forces_3d import coefficients_3d

BY_DOMAIN: dict[type[Domain], Callable[..., Coefficients]] = {
    Domain2D: coefficients_2d,
    Domain3D: coefficients_3d,
}


def force_coefficients(
    domain: Domain, markers: Markers, state: FlowState, reynolds: float
) -> Coefficients:
    """Return the force coefficients of a solved flow, its drag split by pressure and friction.

    Args:
      domain: the discrete problem, in 2-D or 3-D.
      markers: of the body.
      state: of the flow.
      reynolds: U D / nu.
    """
    return BY_DOMAIN[type(domain)](domain, markers, state, reynolds)
