"""Forces in newtons of a flow whose coefficients are known, from speed, size and density."""

import dataclasses
import math

from surrogate.checks import physical_number
from surrogate.errors import InvalidInput

TOLERANCE = 5e-3  # relative, of Re against U D / nu: numbers of three digits agree within it


@dataclasses.dataclass(frozen=True)
class Conditions:
    """The conditions of a flow in SI units.

    Args:
      speed: of the stream U, m/s.
      diameter: equivalent diameter D of the body, m.
      density: of the fluid rho, kg/m^3.
      viscosity: kinematic viscosity nu, m^2/s, where it is known.

    Raises:
      InvalidInput: one is not a number from 1e-12 to 1e12.
    """

    speed: float
    diameter: float
    density: float
    viscosity: float | None = None

    def __post_init__(self):
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is None and field.name == "viscosity":
                continue
            object.__setattr__(self, field.name, physical_number(field.name, value))

    @property
    def reynolds(self) -> float | None:
        """The Reynolds number U D / nu; None where nu is not known."""
        return None if self.viscosity is None else self.speed * self.diameter / self.viscosity

    def viscosity_at(self, reynolds: float) -> float:
        """Return the kinematic viscosity U D / Re in m^2/s at a Reynolds number."""
        return self.speed * self.diameter / reynolds

    def check(self, reynolds: float) -> None:
        """Raise InvalidInput where U D / nu, if nu is known, is not this Reynolds number."""
        given = self.reynolds
        if given is not None and not math.isclose(given, reynolds, rel_tol=TOLERANCE):
            raise InvalidInput(
                f"U D / nu = {given:.6g}, but the flow is at Re {reynolds:.6g}; they must agree "
                "within half a per cent (D is the equivalent diameter in m: the chord in m over "
                "the chord in D)"
            )


@dataclasses.dataclass(frozen=True)
class Forces:
    """The force of the fluid on the body in N and the moment in N m; in 2-D per metre of span.

    Attributes:
      drag: along the stream, N; ``drag_pressure`` and ``drag_friction`` are its parts, which
        surrogates do not know.
      lift: across the stream, along y in 2-D and along z in 3-D, N.
      moment: about the centroid, positive nose up, N m.
    """

    drag: float
    lift: float
    moment: float
    drag_pressure: float | None = None
    drag_friction: float | None = None


def forces_of(coefficients: dict[str, float], conditions: Conditions, dimension: int) -> Forces:
    """Return the forces in N and the moment in N m that have these coefficients.

    Forces are coefficients times (1/2) rho U^2 D, in 3-D (1/2) rho U^2 pi D^2 / 4; the moment is
    multiplied by D too.

    Args:
      coefficients: by the names in ``Forces``.
      conditions: speed U, diameter D and density rho.
      dimension: 2 or 3.
    """
    head = conditions.density * conditions.speed**2 / 2
    unit = head * conditions.diameter
    if dimension == 3:
        unit *= math.pi * conditions.diameter / 4
    values = {name: unit * value for name, value in coefficients.items()}
    return Forces(**values | {"moment": values["moment"] * conditions.diameter})
