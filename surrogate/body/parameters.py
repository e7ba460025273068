"""The shape parameters of bodies: what each one means, its limits and its neutral value.

A new parameter is one more row of ``PARAMETERS`` and its use in the body classes that have it.
"""

import enum
from collections.abc import Iterable
from typing import NamedTuple

HALF_TURN, QUARTER_TURN = 180.0, 90.0
FORMULAS = {
    2: """\
x = -(c/2) cos t, y = b (sin t + beta2 sin 2t + beta3 sin 3t + ... - gamma2 cos 2t - ...),
from the nose, t = 0, over the upper side to the tail, t = pi, and back along the lower one;
aspect = c / (2 b), scaled to area pi/4, so that D = 1.""",
    3: """\
x = -(c/2) cos t from the nose, t = 0, to the tail, t = pi, and around it ellipses of half height
h = b (sin t + beta2 sin 2t + beta3 sin 3t + ...) and half width flatness * h;
aspect = c / (2 b sqrt(flatness)), scaled to volume pi/6, so that D = 1.""",
}
FAMILY = f"{FORMULAS[2]}\nIn 3-D {FORMULAS[3]}"


class Kind(enum.Enum):
    """How a parameter enters a body's contour, and whether drag is smooth in its logarithm."""

    RATIO = "ratio of lengths"  # drag is smooth in its logarithm
    SINE = "sine mode sin kt"  # of the thickness, the same on both sides
    CAMBER = "cosine mode cos kt"  # of the camber line, a polynomial in x
    INCIDENCE = "angle of incidence"  # in degrees, nose up


class Parameter(NamedTuple):
    """One shape parameter: its name, limits, meaning and kind.

    ``neutral`` is its value in bodies that do not name it. ``mode`` is the k of the sine or cosine
    mode that it weighs, None for others.
    """

    name: str
    low: float
    high: float
    neutral: float
    meaning: str
    label: str
    kind: Kind
    mode: int | None = None

    @property
    def widest_range(self) -> tuple[float, float]:
        """Limits of a family's range: those of the parameter, or for incidence -90 and 90."""
        if self.kind is Kind.INCIDENCE:
            return -QUARTER_TURN, QUARTER_TURN
        return self.low, self.high

    @property
    def bounded(self) -> bool:
        """Whether ``low`` and ``high`` hold for every body.

        The limits of sine modes follow from the thickness instead.
        """
        return self.kind is not Kind.SINE

    @property
    def limits(self) -> tuple[float, float]:
        """Least and greatest value that a valid body can have.

        Those of sine modes follow from the thickness: as |sin kt| <= k sin t, a contour that is
        nowhere thinner than zero has |beta_k| <= k.
        """
        if self.kind is Kind.SINE:
            return -float(self.mode), float(self.mode)
        return self.low, self.high

    @property
    def odd_fore_and_aft(self) -> bool:
        """Whether the opposite value gives the same body with nose and tail exchanged."""
        return self.kind is Kind.SINE and self.mode is not None and self.mode % 2 == 0

    @property
    def keeps_mirror_plane(self) -> bool:
        """Whether bodies stay symmetric about y = 0, in 3-D z = 0, whatever its value."""
        return self.kind not in (Kind.CAMBER, Kind.INCIDENCE)


def _sine_mode(k, effect):
    beta = f"\N{GREEK SMALL LETTER BETA}{k}"
    return Parameter(f"beta{k}", -1.0, 1.0, 0.0, effect.lower(), f"{effect}, {beta}", Kind.SINE, k)


def _camber_mode(k, effect):
    label = f"{effect}, \N{GREEK SMALL LETTER GAMMA}{k}"
    return Parameter(f"gamma{k}", -2.0, 2.0, 0.0, effect.lower(), label, Kind.CAMBER, k)


EFFECTS = {  # of negative and of positive values
    2: "Fuller aft (-) or fore (+)",
    3: "Pointed (-) or blunt (+) ends",
    4: "Fuller nose, finer tail (+)",
}
CAMBERS = {2: "Camber, highest in the middle", 3: "Camber aft (-), fore and reflexed (+)"}
RATIOS = (  # limits: what the flow solver is tested for
    Parameter(
        "aspect", 0.1, 20.0, 1.0, "length / thickness", "Aspect, length to thickness", Kind.RATIO
    ),
    Parameter("flatness", 0.2, 5.0, 1.0, "width / height", "Flatness, width to height", Kind.RATIO),
)
INCIDENCE = Parameter(
    *("incidence", -HALF_TURN, HALF_TURN, 0.0, "degrees, nose up"),
    *("Incidence, degrees nose up", Kind.INCIDENCE),
)
PARAMETERS = {
    parameter.name: parameter
    for parameter in (
        *RATIOS,
        *(_sine_mode(k, EFFECTS.get(k, "Waves of the contour")) for k in range(2, 13)),
        *(_camber_mode(k, CAMBERS.get(k, "Waves of the camber line")) for k in range(2, 7)),
        INCIDENCE,
    )
}


def keep_mirror_plane(names: Iterable[str]) -> bool:
    """Return whether bodies with these parameters are all symmetric about y = 0, in 3-D z = 0."""
    return all(PARAMETERS[name].keeps_mirror_plane for name in names)
