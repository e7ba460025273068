"""Correlations of engineering practice for bodies at an incidence, each in its own range.

Cd and Cl are over the cross-section of the sphere of equal volume, whose diameter D makes Re; Cm is
over that and D. Outside of what a correlation was made for it answers None. No paper was at hand;
the codes with which the constants were compared are named with each correlation. One of them, of
spheroids that fall through a gas, is a Python file with a class SystemConstants and a function
systemDynamics, of which the repository is not known here; its comments call some of its conversions
not verified.
"""

import math
from typing import NamedTuple

import numpy as np
from correlations import ellipsoid, stokes_force

from surrogate import family_shape
from surrogate.body.skin import HALVES, Skin, SkinNodes, skin_weights

NODES = SkinNodes(60, 120, HALVES)  # of surface integrals


class Inclined(NamedTuple):
    """A 3-D body of the family at an incidence in degrees; an ellipsoid where ``beta2`` is 0."""

    aspect: float
    flatness: float = 1.0
    beta2: float = 0.0
    incidence: float = 0.0

    @property
    def sphericity(self) -> float:
        """The area of the sphere of equal volume over that of the surface."""
        if not self.beta2:
            return 1 / ellipsoid(self.aspect, self.flatness).surface
        return math.pi / (2 * float(np.linalg.norm(self._areas, axis=1).sum()))

    @property
    def front(self) -> float:
        """The projected area along the stream over that of the sphere; exact of convex bodies."""
        if self.beta2:
            return float(np.abs(self._areas[:, 0]).sum()) / (math.pi / 4)
        body, phi = ellipsoid(self.aspect, self.flatness), math.radians(self.incidence)
        height = math.hypot(body.height * math.cos(phi), body.length * math.sin(phi))
        return 4 * body.width * height

    @property
    def _areas(self):
        """Area vectors of half of the surface, as the body lies in the stream."""
        skin = family_shape(self._asdict(), dimension=3).markers(NODES)
        assert isinstance(skin, Skin)
        return np.asarray(skin.areas) * skin_weights(NODES)[:, None]


class Loads(NamedTuple):
    """The loads by a correlation: Cd, and Cl and Cm where it has them."""

    cd: float | None
    cl: float | None = None
    cm: float | None = None


def froehlich(body: Inclined, re: float, as_in_code: bool = False) -> Loads | None:
    """Return the loads on prolate spheroids at Re 1 to 100, by Froehlich et al. (2020).

    Froehlich, Meinke, Schroeder (J. Fluid Mech. 901, 2020); None outside of the correlation's
    range. Seen: m-AIA (lptellipsoidal.cpp, of the authors' institute) for all constants, and a
    second code for those of drag and moment. m-AIA raises Re to the sum of the last two constants
    of the lift, 0.88 and -0.05, and so does this where ``as_in_code`` is set; else the latter is
    the factor of log(aspect), as that of every other such pair, by which the lift is closer to this
    flow. Near the sphere the moment is too large, by a fifth at aspect 1.25, as it is no linear
    function of aspect - 1.
    """
    aspect = body.aspect
    if body.flatness != 1 or body.beta2 or not (1 < aspect <= 8 and 1 <= re <= 100):
        return None
    log, phi = math.log(aspect), math.radians(body.incidence)
    along, across = stokes_factors(aspect)
    sphere = 1 + 0.15 * re**0.687
    at_0 = sphere - 0.007 * log * re ** (1.17 - 0.07 * log)
    at_90 = sphere + 0.047 * log**1.14 * re ** (0.7 - 0.008 * log)
    scale = 24 / re * 8 / 3 * aspect ** (2 / 3)
    turn = (math.pi / 2) * (2 * phi / math.pi) ** (1 + 0.01 * log**0.86 * math.log(re) ** 1.77)
    spread = math.sin(turn) * math.cos(turn) * (across - along)
    torque = 0.931 * log**0.675 * re**-0.162 + 0.657 * log**2.77 * re ** -(0.178 + 0.177 * log)
    return Loads(
        scale * (at_0 * along + (at_90 * across - at_0 * along) * math.sin(phi) ** 2),
        scale * spread * (1 + 0.34 * re ** (0.88 - 0.05 * (1.0 if as_in_code else log))),
        math.sin(phi) * math.cos(phi) * torque,
    )


def stokes_factors(aspect: float) -> tuple[float, float]:
    """Return the Stokes factors K2 (along the axis) and K0 (across it) of a prolate spheroid."""
    q = math.sqrt(aspect**2 - 1)
    k = math.log((aspect - q) / (aspect + q))
    s0, s1 = -aspect * k / q, aspect**2 / q**2 + aspect * k / (2 * q**3)
    s3 = -2 / q**2 - aspect * k / q**3
    return 1 / (s0 + aspect**2 * s3), 1 / (s0 + s1)


def ouchene(body: Inclined, re: float) -> Loads | None:
    """Return loads on oblate spheroids at Re 1 to 100, by Ouchene (Phys. Fluids 32, 2020).

    Cd is answered along the axis only, and no Cl. None outside of the correlation's range, which is
    taken to be aspects from 0.2 on. Seen: the Python file of the module's docstring, which quotes
    equation 18 for the drag along the axis, and equation 24 for the moment at 45 degrees, over the
    sphere's cross-section and radius; at other angles it is as sin cos here. Near the sphere both
    are wrong: at aspect 0.95 and Re 20 the drag is 23 % too low, and from Re 4 on the moment is a
    quarter too large or more, as it is no linear function of 1 - aspect.
    """
    aspect = body.aspect
    if body.flatness != 1 or body.beta2 or not (0.2 <= aspect < 1 and 1 <= re <= 100):
        return None
    stokes = stokes_force(ellipsoid(aspect)) / (3 * math.pi)
    inertia = 0.15 * aspect**95.91 * re**0.687 + 0.2927 * (1 - aspect) ** 0.4374 * re**0.7512
    along = None if body.incidence else 24 / re * (stokes + inertia)
    phi, torque = math.radians(body.incidence), 1.85 / 2 * (1 / aspect - 1) ** 0.832 * re**-0.146
    return Loads(along, cm=-math.sin(phi) * math.cos(phi) * torque)


def moment_by_inertia(aspect: float, incidence: float) -> float:
    """Return Cm of a spheroid in the limit of small Re, -F sin cos a^3 over pi D^3 / 8.

    F is by Dabade, Marath and Subramanian (J. Fluid Mech. 778, 2015), equations 4.1 and 4.2, and a
    the longer half axis. Seen: the Python file of the module's docstring. F has its limits of
    spheres, 811 pi / 560 times 1 - aspect (Cox 1965), and of discs, and flows converge to it.

    Args:
      aspect: length over thickness, at least 0.1 % from 1, where rounding errors dominate.
      incidence: of the axis to the stream, in degrees.
    """
    phi, half = math.radians(incidence), ellipsoid(aspect)
    factor = prolate_factor(aspect) if aspect > 1 else oblate_factor(aspect)
    longer = max(half.length, half.height)
    return -factor * math.sin(phi) * math.cos(phi) * longer**3 * 8 / math.pi


def prolate_factor(aspect: float) -> float:
    """Return F of a prolate spheroid, negative, see ``moment_by_inertia``."""
    e = math.sqrt(1 - aspect**-2)
    s = math.atanh(e)
    plain = np.polyval([2152, 0, -4249, 0, -2240, 0, -420, 0], e)
    linear = np.polyval([-1470, 0, 1890, 0, 3360, 0, 420], e)
    square = np.polyval([1995, 0, -2730, 0, 1995, 0, -1260, 0], e)
    below = 315 * ((e**2 + 1) * s - e) ** 2 * ((1 - 3 * e**2) * s - e)
    return math.pi * e**2 * float(plain + linear * s + square * s**2) / below


def oblate_factor(aspect: float) -> float:
    """Return F of an oblate spheroid, positive, see ``moment_by_inertia``."""
    e = math.sqrt(1 - aspect**2)
    s = math.asin(e)
    plain = np.polyval([4757, 0, -9989, 0, 3500, 0, -420, 0], e)
    linear = 210 * np.polyval([20, 0, -67, 0, 69, 0, -24, 0, 2], e) / aspect
    square = 105 * np.polyval([24, 0, -17, 0, 12, 0], e)
    along, across = (1 + 2 * e**2) * s - e * aspect, e * aspect - (1 - 2 * e**2) * s
    return math.pi * e**2 * float(plain + linear * s + square * s**2) / (315 * along * across**2)


ZASTAWNY = {  # aspect: a0, ..., a8
    2.5: (2.0, 5.1, 0.48, 15.52, 1.05, 24.68, 0.98, 3.19, 0.21),
    1.25: (1.95, 18.12, 1.023, 4.26, 0.384, 21.52, 0.99, 2.86, 0.26),
}


def zastawny(body: Inclined, re: float) -> Loads | None:
    """Return Cd of two prolate spheroids at Re 0.1 to 300, by Zastawny et al. (2012).

    Int. J. Multiphase Flow 39, 2012; None for other bodies and Re. No code with its constants was
    seen, and those of its lift and moment were not at hand.
    """
    if body.flatness != 1 or body.beta2 or body.aspect not in ZASTAWNY or not 0.1 <= re <= 300:
        return None
    a = ZASTAWNY[body.aspect]
    at_0, at_90 = (a[k] / re ** a[k + 1] + a[k + 2] / re ** a[k + 3] for k in (1, 5))
    return Loads(at_0 + (at_90 - at_0) * math.sin(math.radians(body.incidence)) ** a[0])


def hoelzer_sommerfeld(body: Inclined, re: float) -> Loads:
    """Return Cd by Hoelzer, Sommerfeld 2008 as particle codes use it.

    The crosswise sphericity is in the first and the last term, as in MFiX (sq_drag).
    """
    sphericity, crosswise = body.sphericity, 1 / body.front
    return Loads(
        8 / (re * math.sqrt(crosswise))
        + 16 / (re * math.sqrt(sphericity))
        + 3 / (math.sqrt(re) * sphericity**0.75)
        + 0.42 * 10 ** (0.4 * max(-math.log10(sphericity), 0) ** 0.2) / crosswise
    )


def ganser(body: Inclined, re: float) -> Loads:
    """Return the drag by Ganser (Powder Technology 77, 1993), from sphericity and the area seen.

    Equation 18 and table 7 for bodies that are not isometric, without a vessel's wall: K1 has the
    diameter of the circle with the area that the stream sees, over D. It was fitted to bodies that
    fall freely, of sphericity 0.09 to 1; codes for particles take it at the incidence they have.
    It is no fit of spheres alone: 2 % low at Re 1, 16 % at Re 10 and 26 % at Re 100.

    Seen, with the same constants and decimal logarithm: MFiX (sq_drag, with the incidence), PyFLOW
    2.0 (isometric or not), FALL3D, Kratos, and fallspd.py of NOAA, which quotes K2 as 8.1 and 30
    for the sphericities 0.5 and 0.2.
    """
    sphericity, seen = body.sphericity, math.sqrt(body.front)
    stokes = 1 / (seen / 3 + 2 / 3 / math.sqrt(sphericity))
    newton = 10 ** (1.8148 * max(-math.log10(sphericity), 0) ** 0.5743)
    share = re * stokes * newton
    part = 24 / share * (1 + 0.1118 * share**0.6567) + 0.4305 / (1 + 3305 / share)
    return Loads(newton * part)


AT_INCIDENCE = {
    "Froehlich": froehlich,
    "Ouchene": ouchene,
    "Zastawny": zastawny,
    "Hoelzer-Sommerfeld": hoelzer_sommerfeld,
    "Ganser": ganser,
}
