"""The box around all bodies of a 2-D family with camber or incidence, by interval arithmetic.

With the centroid of the area at the origin a contour of such a family is, before it is turned,

    x = -(c/2) (cos t - m1),   y = b (sin t + sum beta_k sin kt - sum gamma_k (cos kt - mk)),

where mk = (beta_(k+1) - beta_(k-1)) / 2 is the mean of cos kt over the area, with beta_1 = 1.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from surrogate.body.parameters import PARAMETERS, Kind

NODES = 1024
MARGIN = 1.005  # over what lies between the nodes, and over the centroids of polygons


@dataclasses.dataclass(frozen=True)
class Interval:
    """An interval of numbers from ``low`` to ``high``, at each node of a contour."""

    low: Float[np.ndarray, " nodes"]
    high: Float[np.ndarray, " nodes"]

    def __add__(self, other: "Interval") -> "Interval":
        return Interval(self.low + other.low, self.high + other.high)

    def __mul__(self, other: "Interval") -> "Interval":
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Interval(np.min(ends, axis=0), np.max(ends, axis=0))

    @property
    def largest(self) -> Float[np.ndarray, " nodes"]:
        """Greatest absolute value in the interval, at each node."""
        return np.maximum(np.abs(self.low), np.abs(self.high))


def cambered_extent(ends: Mapping[str, Float[np.ndarray, "2"]]) -> tuple[float, float]:
    """Return length and height in D of a box, centred at the origin, that holds every body.

    Args:
      ends: least and greatest value of each parameter by its name, ``aspect`` among them; of the
        incidence from -90 to 90 degrees.
    """
    t = 2 * np.pi * np.arange(NODES) / NODES

    def weight(name):
        return _interval(*ends.get(name, (0.0, 0.0)))

    def beta(k):
        return _number(1.0) if k == 1 else weight(f"beta{k}")

    def cosine(k):  # cos kt less its mean over the area
        return _number(np.cos(k * t)) + _number(0.5) * (beta(k - 1) + _number(-1.0) * beta(k + 1))

    height = _number(np.sin(t))
    for p in PARAMETERS.values():
        if p.kind is Kind.SINE:
            height += weight(p.name) * _number(np.sin(p.mode * t))
        elif p.kind is Kind.CAMBER:
            height += weight(p.name) * _number(-1.0) * cosine(p.mode)
    turns = _turns(*ends.get("incidence", (0.0, 0.0)))
    along, across = cosine(1).largest / 2, height.largest / 2
    roots = np.sqrt(ends["aspect"])  # the sides of a turned body are convex in the root
    sides = np.array([_turned(along * root, across / root, turns) for root in roots])
    length, height = 2 * MARGIN * sides.max(axis=(0, 2))
    return float(length), float(height)


def turned_box(
    half_length: Float[np.ndarray, " boxes"],
    half_height: Float[np.ndarray, " boxes"],
    incidence: Float[np.ndarray, "2"],
) -> tuple[float, float]:
    """Return half length and half height of a box around all boxes at every incidence of a range.

    Args:
      half_length: of the boxes, in D.
      half_height: of the boxes, in D.
      incidence: least and greatest one, in degrees.
    """
    x, y = _turned(half_length, half_height, _turns(*incidence))
    return float(x.max()), float(y.max())


def _interval(low, high):
    return Interval(np.full(NODES, low), np.full(NODES, high))


def _number(value):
    return _interval(value, value)


def _turns(low, high):
    """Return the least and the greatest turn in radians, either way."""
    least = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
    return np.deg2rad([least, max(abs(low), abs(high))])


def _turned(x, y, turns):
    """Return the greatest |x| and |y| of the corners (+-x, +-y), turned by up to 90 degrees."""
    radius, lean = np.hypot(x, y), np.arctan2(y, x)
    flattest, steepest = (np.clip(at, *turns) for at in (lean, np.pi / 2 - lean))
    return radius * np.cos(flattest - lean), radius * np.sin(steepest + lean)
