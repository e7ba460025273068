"""Closed contours: checked, smoothed, and resampled to markers at equidistant t."""

import re

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree
from shapely import LinearRing

from surrogate.arrays import AnyArray
from surrogate.body.measures import AREA, moments
from surrogate.checks import whole_number
from surrogate.errors import InvalidInput

FINE = 4096  # points of the intermediate resampling: far more than markers
LEAST_WAVE = 0.03  # of a contour's first harmonic: waves that take more harmonics of the traction
JUDGED = 200  # markers by which the loss to smoothing is judged; coarse grids have some 100
LARGEST_LOSS = 0.2  # D from a smoothed contour to what was given, above which it is refused


def naca_digits(code: str | int) -> str:
    """Return the digits of a NACA section that may be named with them, as "NACA 2412"."""
    return re.sub("^naca", "", str(code), flags=re.IGNORECASE).strip()


def naca4(code: str | int, points: int = 200) -> Float[AnyArray, "points 2"]:
    """Return a NACA 4-digit section with a closed trailing edge, chord 1, nose at the origin.

    The points lead from the nose over the upper side to the tail and back along the lower side.

    Args:
      code: the four digits, as "0012", "NACA 2412" or 2412.
      points: number of points, rounded down to an even number; at least 8.

    Raises:
      InvalidInput: the code is not four digits of a section with a thickness, or ``points`` is out
        of range.
    """
    points = whole_number("points", points, 8, 10**6)
    digits = naca_digits(code)
    if not re.fullmatch(r"[0-9]{4}", digits) or digits.endswith("00"):
        hint = "; contour_shape(read_contour(file)) makes a body of a file" if "." in digits else ""
        raise InvalidInput(
            f"NACA {digits}: four digits with a thickness above 00 are needed, as 0012{hint}"
        )
    camber, position, thickness = int(digits[0]) / 100, int(digits[1]) / 10, int(digits[2:]) / 100
    if (camber > 0) != (position > 0):
        raise InvalidInput(f"NACA {digits}: camber and its position must both be zero or neither")
    x = (1 - np.cos(np.linspace(0, np.pi, points // 2 + 1))) / 2
    half = (
        5
        * thickness
        * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    )
    line, slope = np.zeros_like(x), np.zeros_like(x)
    if camber > 0:
        front = x < position
        part = np.where(front, position, 1 - position)
        line = (
            camber
            / part**2
            * np.where(front, 2 * position * x - x**2, 1 - 2 * position + 2 * position * x - x**2)
        )
        slope = 2 * camber / part**2 * (position - x)
    angle = np.arctan(slope)
    upper = np.stack([x - half * np.sin(angle), line + half * np.cos(angle)], axis=1)
    lower = np.stack([x + half * np.sin(angle), line - half * np.cos(angle)], axis=1)
    return np.concatenate([upper, lower[-2:0:-1]])


def contour_curve(
    points: Float[AnyArray, "points 2"], keep_size: bool
) -> Float[np.ndarray, "fine 2"]:
    """Return a contour as a fine curve: clockwise from the nose, centroid at 0.

    Its points are equidistant in a parameter t that runs faster where the contour bends less,
    ds/dt ~ curvature^(-1/3): on an ellipse that is its own angle, so noses and tails get the
    markers they need.

    Args:
      points: x and y once around, in order.
      keep_size: keep the area that was given, else it is pi/4.

    Raises:
      InvalidInput: fewer than 8 finite points, no area, a size that cannot be scaled, the contour
        crosses or touches itself, or smoothing would move it by more than 0.2 D.
    """
    points, area, centroid = _checked(points)
    points = points if area > 0 else points[::-1]
    points = (points - centroid) * _scale(area, keep_size)
    points = np.roll(points, -int(np.argmin(points[:, 0])), axis=0)
    curve = _by_bend(_by_length(points, FINE))
    off = _farthest(curve, _fourier(curve, JUDGED))
    if off > LARGEST_LOSS:
        length = np.ptp(points[:, 0])
        given = f" ({length:.3g} D long as given; without keep_size its area is scaled)"
        raise InvalidInput(
            f"contour: {off:.2g} D of it would be lost to smoothing{given if keep_size else ''}; "
            "fewer, larger waves are kept"
        )
    return curve


def smoothed(
    curve: Float[np.ndarray, "fine 2"], nodes: int, keep_size: bool
) -> Float[np.ndarray, "nodes 2"]:
    """Return markers at equidistant t on a curve whose corners a Fourier series rounds.

    Args:
      curve: from ``contour_curve``.
      nodes: number of markers; harmonics above an eighth of it fade out.
      keep_size: keep the area that was given, else it is pi/4.
    """
    smooth = _fourier(curve, nodes)
    area, centroid = (np.asarray(value) for value in moments(smooth))
    return (smooth - centroid) * _scale(area, keep_size)


def _checked(points):
    """Return distinct points as floats, their area (negative if anticlockwise) and centroid."""
    if np.ma.is_masked(points):
        raise InvalidInput("contour: some of its points are masked; leave them out")
    try:
        points = np.asarray(points)
    except ValueError:
        points = np.empty(0, object)  # rows of unlike lengths
    if points.dtype.kind not in "iuf" or points.ndim != 2 or points.shape[1] != 2:
        raise InvalidInput("contour: an array of shape (points, 2) of real numbers is needed")
    if len(points) < 8 or not np.all(np.isfinite(points)):
        raise InvalidInput(f"contour: {len(points)} points; at least 8 finite ones are needed")
    points = points.astype(float)
    size = np.ptp(points, axis=0).max()
    if not 1e-9 < size < 1e9:
        raise InvalidInput(f"contour: its size is {size:g}; from 1e-9 to 1e9 can be scaled")
    if np.spacing(np.abs(points).max()) > 1e-7 * size:
        raise InvalidInput("contour: so far from the origin its points lose their digits; move it")
    points = points - points.mean(axis=0)
    points = _distinct(points)
    if len(points) < 8:
        raise InvalidInput(f"contour: {len(points)} distinct points; at least 8 are needed")
    if np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[1][1] < 1e-9 * size:
        raise InvalidInput("contour: it encloses no area")
    if crosses_itself(points):
        raise InvalidInput(
            "contour: it crosses or touches itself; list the points once around, in order"
        )
    area, centroid = (np.asarray(value) for value in moments(points))
    if not abs(area) > 1e-9 * size**2:
        raise InvalidInput("contour: it encloses no area")
    return points, area, centroid


def contour_length(points: Float[AnyArray, "points 2"], keep_size: bool) -> float:
    """Return the extent along x in D of a valid contour, scaled as by ``contour_curve``."""
    points = np.asarray(points, float)
    area, _ = moments(points - points.mean(axis=0))
    return float(_scale(area, keep_size) * np.ptp(points[:, 0]))


def _scale(area, keep_size):
    """Return the factor by which a contour has the area pi/4, or 1 to keep its size."""
    return 1.0 if keep_size else float(np.sqrt(AREA / abs(float(area))))


def _farthest(points, smooth):
    """Return the greatest distance of the points from the smooth contour."""
    return float(cKDTree(smooth).query(points)[0].max())


def crosses_itself(points: Float[AnyArray, "points 2"]) -> bool:
    """Return whether the closed polygon crosses or touches itself anywhere but where edges meet."""
    return not LinearRing(points).is_simple


def _distinct(points):
    gaps = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
    return points[gaps > 1e-9 * max(np.ptp(points), 1e-300)]


def highest_harmonic(contour: Float[np.ndarray, "nodes 2"]) -> int:
    """Return the highest harmonic of a smoothed contour of more than 3 % of the first."""
    waves = np.abs(np.fft.fft(contour[:, 0] + 1j * contour[:, 1]))
    half = len(waves) // 2
    size = np.maximum(waves[1:half], waves[:half:-1])  # both senses of rotation
    return int(np.flatnonzero(size > LEAST_WAVE * size.max())[-1]) + 1


def _by_length(points, count):
    """Resample a closed polygon at equidistant arc length; corners stay."""
    closed = np.concatenate([points, points[:1]])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    s = np.arange(count) / count * length[-1]
    return np.stack([np.interp(s, length, closed[:, k]) for k in (0, 1)], axis=1)


def _by_bend(points):
    """Resample so that equidistant indices mean equidistant affine arc length."""
    count = len(points)
    smooth = gaussian_filter1d(points, count / 60, axis=0, mode="wrap")
    first = np.gradient(np.pad(smooth, ((2, 2), (0, 0)), mode="wrap"), axis=0)
    second = np.gradient(first, axis=0)[2:-2]
    first = first[2:-2]
    speed = np.linalg.norm(first, axis=1)
    bend = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    typical = 2 * np.pi / np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    density = gaussian_filter1d((bend**2 + (typical / 2) ** 2) ** (1 / 6), count / 60, mode="wrap")
    t = np.concatenate([[0], np.cumsum((density + np.roll(density, -1)) / 2)])
    index = np.interp(np.arange(count) / count * t[-1], t, np.arange(count + 1))
    curve = CubicSpline(
        np.arange(count + 1), np.concatenate([points, points[:1]]), bc_type="periodic"
    )
    return curve(index)


def _fourier(points, nodes):
    """Return a Fourier series at ``nodes`` points, whose harmonics above nodes / 8 fade out."""
    wave = np.fft.fftfreq(len(points), 1 / len(points))
    spectrum = np.fft.fft(points, axis=0) * np.exp(-((wave / (nodes / 8)) ** 4))[:, None]
    known = min(nodes, len(points))
    ahead, behind = spectrum[: (known + 1) // 2], spectrum[len(points) - (known - 1) // 2 :]
    between = np.zeros((nodes - len(ahead) - len(behind), 2))
    kept = np.concatenate([ahead, between, behind])
    return np.fft.ifft(kept, axis=0).real * nodes / len(points)
