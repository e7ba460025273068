"""A body's chord: loads by it, its points as it lies in the stream, and moments about them."""

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.incidence import rotate
from surrogate.body.shape import Shape

DIAMETER, CHORD = "diameter", "chord"  # names of reference lengths, in files and options
FORCE_POWER, MOMENT_POWER = 1, 2  # of the chord, by which Cd and Cl, and Cm, by D are divided
POWERS = np.array([FORCE_POWER, FORCE_POWER, MOMENT_POWER])
FLAT = 1e-3  # of the length, by which the smoothed points of a flat face lie behind one another


def loads_by_chord(
    loads: Float[AnyArray, " loads"], chord: Float[AnyArray, ""] | float
) -> Float[AnyArray, " loads"]:
    """Return coefficients by the chord, Cd / c, Cl / c and Cm / c^2, from those by D.

    Args:
      loads: Cd and, where there are any, Cl and Cm.
      chord: c in D.
    """
    return loads / chord ** POWERS[: len(loads)]


def chord_point(shape: Shape, station: float) -> Float[np.ndarray, "2"]:
    """Return the point of the chord at x/c = ``station``, in D from the centroid.

    The chord is the straight line from the nose to the tail, the farthest points of the contour
    upstream and downstream at zero incidence, of a flat face its middle; in 3-D, in the plane of
    symmetry.

    Args:
      shape: the body at its incidence.
      station: 0 is the nose, 1 the tail; points ahead of the body or behind it are allowed.
    """
    nose, slope = _nose_and_slope(shape)
    point = nose + station * shape.chord * np.array([1.0, slope])
    return rotate(point[None], shape.incidence)[0]


def centroid_station(shape: Shape) -> float:
    """Return x/c of the centroid, measured along the x axis at zero incidence."""
    return -float(_nose_and_slope(shape)[0][0]) / shape.chord


def moment_about(point: Float[np.ndarray, "2"], drag: float, lift: float, moment: float) -> float:
    """Return Cm about a point from Cd, Cl and Cm about the centroid, nose up.

    Args:
      point: in D from the centroid, x along the stream and the second coordinate along the lift.
      drag: Cd.
      lift: Cl.
      moment: Cm.
    """
    return float(moment - point[1] * drag + point[0] * lift)


def _nose_and_slope(shape):
    """Return the nose of the body at zero incidence, and the slope of its chord."""
    upright = rotate(shape.contour, -shape.incidence)
    nose, tail = _end(upright, -1), _end(upright, 1)
    return nose, (tail[1] - nose[1]) / (tail[0] - nose[0])


def _end(contour, sense):
    """Return the farthest point upstream (``sense`` -1) or downstream (1)."""
    behind = sense * (contour[:, 0] - sense * np.max(sense * contour[:, 0]))
    face = contour[behind > -FLAT * np.ptp(contour[:, 0])]
    return np.array([sense * np.max(sense * face[:, 0]), (face[:, 1].min() + face[:, 1].max()) / 2])
