"""The onset of vortex shedding behind a 2-D body, from the reverse flow of its steady wake.

The rule of ``surrogate.scene.limits`` knows the body's outline alone. Where the flow has been
solved at a Reynolds number Re near the onset Re_c of that rule, the wake says more. With the mean
speed u_r of all reverse flow, weighted with itself,

    onset = Re (Re_c / Re)^outline (u_c / u_r)^wake,   u_c = speed Re^-fall,

where u_c is the u_r that a body typically has at its onset. Reverse flow lets disturbances grow
where they are, in place of being swept away; a wake sheds vortices where the region in which they
do is long and strong enough (Huerre and Monkewitz 1990). The formula itself is empirical.
"""

import math
from typing import NamedTuple

import numpy as np
import shapely
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.shape import Shape
from surrogate.flow.fields import polygon_of

NEAR = (0.85, 1.2)  # Re over Re_c where the wake is asked; study ``onset_2d`` has its errors there
# Bounds of the estimate over Re_c, which is up to 16 % late and 13 % early (study ``onset_2d``).
LEAST, MOST = 0.75, 1.25


class WakeRule(NamedTuple):
    """Constants of the onset by the wake, the exponents and the factor of the module's formula."""

    outline: float
    wake: float
    speed: float
    fall: float


# Fitted to the bodies of study ``onset_2d`` to which the rule is fitted, by ``fit_wake`` there.
RULE = WakeRule(0.468, 0.351, 0.278, 0.3444)


def onset_by_wake(reynolds: float, onset: float, speed: float) -> float:
    """Return the onset of shedding by the outline's rule and the reverse flow.

    Args:
      reynolds: of the flow, U D / nu with the equivalent diameter D of the body.
      onset: by the rule of the body's outline, with the same D.
      speed: of the reverse flow over U, from ``reverse_speed``.
    """
    usual = RULE.speed * reynolds**-RULE.fall
    more = (usual / speed) ** RULE.wake if speed else math.inf
    estimate = reynolds * (onset / reynolds) ** RULE.outline * more
    return min(max(estimate, LEAST * onset), MOST * onset)


def reverse_speed(
    u: Float[np.ndarray, "nx ny"],
    x: Float[AnyArray, " nx"],
    y: Float[AnyArray, " ny"],
    shape: Shape,
) -> float:
    """Return the mean speed of the reverse flow outside a 2-D body, weighted with itself, over U.

    It is the integral of u^2 over that of |u| where u < 0; 0 where no flow is reversed.

    Args:
      u: velocity along the stream over U, at the points of an even grid.
      x: of the points, in D.
      y: of the points, in D.
      shape: the body.
    """
    i, j = np.nonzero(u < 0)
    inside = shapely.contains_xy(polygon_of(shape), x[i], y[j])
    reverse = -u[i, j][~inside]
    return float(reverse @ reverse / reverse.sum()) if reverse.size else 0.0
