"""Ellipsoids in a fluid, exactly: added masses and the resistance to rotation, by potentials."""

import math
from typing import NamedTuple

from scipy.special import elliprd

DISPLACED = math.pi / 6  # volume of every body, in D^3: the mass of the fluid that it displaces


class Ellipsoid(NamedTuple):
    """An ellipsoid by its half axes in D: along the body's axis, across it in width and in height.

    Its motion is in the plane of length and height. Masses are over rho D^3, moments of inertia
    over rho D^5.
    """

    length: float
    width: float
    height: float

    @property
    def added_masses(self) -> tuple[float, float]:
        """Masses of fluid accelerated with it, along its axis and its height (Lamb, art. 114)."""
        along, across = self._potentials
        return DISPLACED * along / (2 - along), DISPLACED * across / (2 - across)

    @property
    def inertia(self) -> float:
        """Moment of inertia about the width axis, of an ellipsoid of the fluid's density."""
        return DISPLACED * (self.length**2 + self.height**2) / 5

    @property
    def added_inertia(self) -> float:
        """Moment of inertia of the fluid that is rotated with it (Lamb, art. 115)."""
        (along, across), a, c = self._potentials, self.length**2, self.height**2
        if math.isclose(a, c, rel_tol=1e-9):
            return 0.0
        share = (a - c) ** 2 * (across - along) / (2 * (a - c) + (a + c) * (along - across))
        return DISPLACED * share / 5

    @property
    def resistance_to_rotation(self) -> float:
        """Torque in Stokes flow divided by mu D^3 and by the angular velocity (Jeffery 1922)."""
        (along, across), a, c = self._potentials, self.length**2, self.height**2
        volume = self.length * self.width * self.height
        return 16 * math.pi * volume * (a + c) / (3 * (a * along + c * across))

    @property
    def _potentials(self):
        """Lamb's alpha along the axis and along the height; all three add up to 2."""
        a, b, c = (half**2 for half in self)
        volume = 2 / 3 * self.length * self.width * self.height
        return volume * float(elliprd(b, c, a)), volume * float(elliprd(a, b, c))


def equivalent_ellipsoid(aspect: float, flatness: float = 1.0) -> Ellipsoid:
    """Return the ellipsoid of volume pi/6 with this length / thickness and width / height.

    The thickness is the height times sqrt(flatness), the diameter of the round cross-section of
    the same area.
    """
    half = aspect ** (-1 / 3) / 2
    return Ellipsoid(aspect * half, half * math.sqrt(flatness), half / math.sqrt(flatness))
