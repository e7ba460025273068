"""The nose of a body: the radius of curvature that its thinnest boundary layer follows."""

import math

import numpy as np
from jaxtyping import Float

from surrogate.body.measures import AREA, moments

SHARPEST_ARC = 1.0  # radian, by which the arc turns whose radius of curvature is that of a nose
# A sharp nose counts as one of three times its radius, since less of the layer is thin (fitted to
# errors of Cl on random sections like those of study ``random_sections``, by other seeds).
SHARP_NOSE = 3.0
CORNER = 0.004  # D: the markers of a flow round what is sharper


def nose_of_ellipse(chord: float, area: float = AREA) -> float:
    """Return the radius of curvature in D at the nose of an ellipse.

    Args:
      chord: its axis along the stream at zero incidence, in D.
      area: in D^2, by default that of all bodies whose size is not their own.
    """
    return 8 * area**2 / (math.pi**2 * chord**3)


def nose_of_contour(contour: Float[np.ndarray, "nodes 2"], chord: float) -> float:
    """Return the radius of curvature in D that the thinnest boundary layer of a body follows.

    It is that of the nose of an ellipse of this chord and of the same area, or three times that of
    the body's own nose if that is smaller: the length of the shortest arc upstream of the centroid
    that turns by a radian. Corners count as noses of 0.004 D.

    Args:
      contour: x and y in D once around, centroid at 0, by many nodes.
      chord: of the body in D.
    """
    steps = np.diff(contour, axis=0, append=contour[:1])
    lengths = np.hypot(*steps.T)
    turned = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    turned *= np.sign(turned[-1] - turned[0])
    along = np.cumsum(lengths) - lengths / 2
    turned = np.concatenate([turned, turned + 2 * np.pi])
    along = np.concatenate([along, along + lengths.sum()])
    furthest = np.maximum.accumulate(turned)  # where the contour is concave it turns back
    arcs = np.interp(furthest + SHARPEST_ARC, furthest, along) - along
    convex = (turned >= furthest)[: len(contour)]
    upstream = contour[:, 0] + steps[:, 0] / 2 < 0
    sharpest = float(arcs[: len(contour)][convex & upstream].min()) / SHARPEST_ARC
    area = abs(float(moments(contour)[0]))
    return min(nose_of_ellipse(chord, area), SHARP_NOSE * max(sharpest, CORNER))
