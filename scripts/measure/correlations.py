"""Drag correlations of engineering practice for ellipsoids, by what each knows of their shape.

Cd is over the cross-section of the sphere of equal volume, whose diameter D makes the Reynolds
number too; half axes are in D, the first along the stream.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ellipe, elliprd, elliprf, elliprg


class Ellipsoid(NamedTuple):
    """An ellipsoid by its half axes in D, along the stream and across it."""

    length: float
    width: float
    height: float

    @property
    def surface(self) -> float:
        """The surface's area over that of the sphere of equal volume; one over the sphericity."""
        a, b, c = (axis**2 for axis in self)
        return 4 * float(elliprg(a * b, a * c, b * c))

    @property
    def front(self) -> float:
        """The area that the stream sees, over the sphere's."""
        return 4 * self.width * self.height

    @property
    def turned(self) -> "Ellipsoid":
        """The same ellipsoid nose up by 90 degrees, its length and height exchanged."""
        return Ellipsoid(self.height, self.width, self.length)

    @property
    def side(self) -> float:
        """The area seen from across the stream, averaged round it, over the sphere's."""
        low, high = sorted([self.width, self.height])
        return 8 / np.pi * self.length * high * float(ellipe(1 - (low / high) ** 2))


def ellipsoid(aspect: float, flatness: float = 1.0) -> Ellipsoid:
    """Return the ellipsoid of volume pi/6 with these ratios length / thickness, width / height."""
    half = aspect ** (-1 / 3) / 2
    return Ellipsoid(aspect * half, half * flatness**0.5, half / flatness**0.5)


def oberbeck(body: Ellipsoid, reynolds: float) -> float:
    """Return Cd of an ellipsoid, exact in Stokes flow (Oberbeck 1876), with Oseen's correction.

    At small Re the ``stokes_force`` F grows by F Re / (16 pi) (Brenner, J. Fluid Mech. 11, 1961).
    """
    force = stokes_force(body)
    return 8 * force / (np.pi * reynolds) * (1 + force * reynolds / (16 * np.pi))


def stokes_force(body: Ellipsoid) -> float:
    """Return the force on an ellipsoid in Stokes flow over mu U D, exact by its own potentials.

    Oberbeck, J. reine angew. Math. 81, 1876.
    """
    a, b, c = (axis**2 for axis in body)
    potential = 2 * elliprf(a, b, c) + a * 2 / 3 * elliprd(b, c, a)
    return 16 * np.pi / float(potential)


def hoelzer_sommerfeld(body: Ellipsoid, reynolds: float) -> float:
    """Return Cd of a body held at its angle to the stream, by Hoelzer and Sommerfeld (2008).

    Powder Technology 184, 2008. By sphericity; crosswise sphericity, the sphere's cross-section
    over the area that the stream sees; and lengthwise sphericity, the same over half the surface
    less the area seen from the side.
    """
    sphericity, crosswise = 1 / body.surface, 1 / body.front
    lengthwise = 1 / (2 * body.surface - body.side)
    return (
        8 / (reynolds * np.sqrt(lengthwise))
        + 16 / (reynolds * np.sqrt(sphericity))
        + 3 / (np.sqrt(reynolds) * sphericity**0.75)
        + 0.42 * 10 ** (0.4 * max(-np.log10(sphericity), 0) ** 0.2) / crosswise
    )


def haider_levenspiel(body: Ellipsoid, reynolds: float) -> float:
    """Return Cd of bodies that fall freely, by their sphericity.

    Haider, Levenspiel (Powder Technology 58, 1989).
    """
    phi = 1 / body.surface
    a = np.exp(2.3288 - 6.4581 * phi + 2.4486 * phi**2)
    b = 0.0964 + 0.5565 * phi
    c = np.exp(4.905 - 13.8944 * phi + 18.4222 * phi**2 - 10.2599 * phi**3)
    d = np.exp(1.4681 + 12.2584 * phi - 20.7322 * phi**2 + 15.8855 * phi**3)
    return 24 / reynolds * (1 + a * reynolds**b) + c / (1 + d / reynolds)


def bagheri_bonadonna(body: Ellipsoid, reynolds: float) -> float:
    """Return Cd over random orientations by Bagheri, Bonadonna (Powder Technology 301, 2016).

    By flatness (shortest over intermediate axis) and elongation (intermediate over longest), for
    Re up to 3e5. For a ratio r of the densities of body and fluid, k_N = 10^(a (-log10 F_N)^b) has
    a = 0.45 + 10 / (exp(2.5 log10 r) + 30) and b = 1 - 37 / (exp(3 log10 r) + 100). Here r is
    infinite (k_N within 2 % from r = 1000), as in a liquid the orientation is not random. The
    sphere's Cd is 1 % low at Re 1, 12 % at Re 10 and 18 % at Re 100.

    The paper was not at hand. Seen, with the same constants: FLEXPART 11 (settling_mod.f90), and
    LagTrack (get_trajectory.m) of the authors' group, for air, where b is 0.99.
    """
    short, middle, long = sorted(body)
    flatness, elongation = short / middle, middle / long
    bulk = 1 / (8 * short * middle * long)
    stokes = flatness * elongation**1.3 * bulk
    newton = flatness**2 * elongation * bulk
    slow = (stokes ** (1 / 3) + stokes ** (-1 / 3)) / 2
    fast = 10 ** (0.45 * max(-np.log10(newton), 0))
    share = reynolds * fast / slow
    return 24 * slow / reynolds * (1 + 0.125 * share ** (2 / 3)) + 0.46 * fast / (1 + 5330 / share)


CORRELATIONS = {
    "Hoelzer-Sommerfeld": hoelzer_sommerfeld,
    "Haider-Levenspiel": haider_levenspiel,
    "Bagheri-Bonadonna": bagheri_bonadonna,
}
