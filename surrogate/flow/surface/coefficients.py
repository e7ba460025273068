"""Force coefficients of a solved flow, with the parts of drag by pressure and by friction."""

import functools
from typing import NamedTuple

from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.solver.steady import FlowState


class Coefficients(NamedTuple):
    """Force of the fluid on the body over (1/2) rho U^2 D per unit span; in 3-D over pi D^2 / 4.

    ``moment`` is about the centroid, positive nose up, over (1/2) rho U^2 D^2.
    """

    drag: Float[AnyArray, ""]
    drag_pressure: Float[AnyArray, ""]
    drag_friction: Float[AnyArray, ""]
    lift: Float[AnyArray, ""]
    moment: Float[AnyArray, ""]


@functools.singledispatch
def force_coefficients(
    domain: Domain, markers: Markers, state: FlowState, reynolds: float
) -> Coefficients:
    """Return the force coefficients of a solved body; each class of domain has its own."""
    raise TypeError(f"no force coefficients for a {type(domain).__name__}")
