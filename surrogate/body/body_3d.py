"""Bodies in 3-D: the meridian of 2-D on elliptic cross-sections, of volume pi/6.

    x = -(c/2) mu,   y = w s q cos phi,   z = h s q sin phi,   mu = cos t,  s = sin t,

with s q = sin t + beta2 sin 2t + ..., so that q is a sum of Chebyshev polynomials of mu. Flatness
is w / h (1: a body of revolution), aspect c / (2 sqrt(w h)). The body is turned nose up by its
incidence in the plane of x and z.
"""

import dataclasses
import itertools
from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import legendre
from scipy.optimize import lsq_linear
from scipy.special import chebyu

from surrogate.arrays import AnyArray, picked
from surrogate.body.body_2d import Body2D
from surrogate.body.body_class import BodyClass, Range
from surrogate.body.extent import turned_box
from surrogate.body.incidence import rotate
from surrogate.body.parameters import PARAMETERS, Kind
from surrogate.body.skin import Skin, SkinNodes, skin_grid

ASPECTS = 33  # of a range, at which its bodies at incidence are boxed
GAUSS = legendre.leggauss(32)  # exact for the squares of twelve modes


@dataclasses.dataclass(frozen=True)
class Body3D(BodyClass):
    """The class of 3-D bodies, with the mirror plane y = 0, and z = 0 as well at zero incidence."""

    dimension = 3
    available = tuple(name for name, p in PARAMETERS.items() if p.kind is not Kind.CAMBER)
    default_ranges: ClassVar[Mapping[str, Range]] = {
        **Body2D.default_ranges,
        "aspect": (0.7, 4.0),
        "flatness": (1.0, 2.0),
    }
    round_body = "sphere"
    size = "volume pi/6"

    def half_axes(
        self, parameters: Float[AnyArray, " parameters"]
    ) -> tuple[Float[Array, ""], Float[Array, ""], Float[Array, ""]]:
        """Return (c / 2, w, h), the half axes in D of the ellipsoid before the modes are added.

        They are scaled so that the body with its modes has the volume pi/6.
        """
        aspect, flatness = self.aspect(parameters), self.flatness(parameters)
        thickness = self._mean_thickness(aspect, self.betas(parameters))
        return (
            aspect * thickness / 2,
            thickness * jnp.sqrt(flatness) / 2,
            thickness / jnp.sqrt(flatness) / 2,
        )

    def outline(
        self, parameters: Float[AnyArray, " parameters"], nodes: int
    ) -> Float[Array, "nodes 2"]:
        """Return the contour of the side view at zero incidence, clockwise from the nose."""
        t, y = self._profile(parameters, nodes)
        half_length, _, half_height = self.half_axes(parameters)
        x = -half_length * (np.cos(t) - self._centroid(self.betas(parameters)))
        return jnp.stack([x, half_height * y], axis=1)

    def markers(self, parameters: Float[AnyArray, " parameters"], nodes: SkinNodes) -> Skin:
        """Return the skin as the body lies in the stream, at the nodes of ``skin_grid``."""
        return Skin(*self.skin_at(parameters, *skin_grid(nodes)), nodes)

    def skin_at(
        self,
        parameters: Float[AnyArray, " parameters"],
        mu: Float[np.ndarray, " points"],
        phi: Float[np.ndarray, " points"],
    ) -> tuple[Float[Array, "points 3"], Float[Array, "points 3"]]:
        """Return points on the surface as it lies, and their area vectors per unit mu and phi.

        Args:
          parameters: of one body.
          mu: cos t, from 1 at the nose to -1 at the tail.
          phi: angle around the body's axis in radians, 0 at y > 0 and pi / 2 at z > 0.
        """
        length, width, height = self.half_axes(parameters)
        q, slope = self._fullness(parameters, mu)
        s, y, z = np.sqrt(1 - mu**2), np.cos(phi), np.sin(phi)
        x = -length * (mu - self._centroid(self.betas(parameters)))
        points = jnp.stack([x, width * s * q * y, height * s * q * z], axis=1)
        along = width * height * ((1 - mu**2) * q * slope - mu * q**2)
        areas = jnp.stack([along, length * height * s * q * y, length * width * s * q * z], axis=1)
        if "incidence" not in self.names:
            return points, areas
        incidence = picked(parameters, self.names.index("incidence"))
        return rotate(points, incidence), rotate(areas, incidence)

    def extent(
        self, parameters: Float[AnyArray, " parameters"], contour: Float[AnyArray, "nodes 2"]
    ) -> Float[np.ndarray, "3"]:
        """Return length, width and height in D of a box, centred at the origin, around the body.

        Length and height follow from the ``contour`` of its side view as it lies.
        """
        length, height = 2 * np.abs(contour).max(axis=0)
        upright = np.asarray(self.outline(jnp.asarray(parameters), len(contour)))[:, 1]
        width = 2 * np.abs(upright).max() * float(self.flatness(parameters))
        return np.array([length, width, height])

    def family_extent(
        self, bounds: Float[np.ndarray, "parameters 2"]
    ) -> tuple[float, float, float]:
        """Return length, width and height in D of a box, centred at the origin, around every body.

        By the least volume over that of the ellipsoid, and the centroids of extreme modes.
        """
        ends = dict(zip(self.names, bounds, strict=True))
        (low, high), mu, weight = bounds[self.indices(Kind.SINE)].T, *GAUSS
        root = np.sqrt(weight * (1 - mu**2))
        slimmest = np.zeros(0)
        if self.modes:
            slimmest = lsq_linear((root * self._waves(mu)).T, -root, (low, high), tol=1e-12).x
        corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
        off = np.abs(self._centroid(corners)).max()
        aspects = np.geomspace(*ends["aspect"], ASPECTS)
        thickness = self._mean_thickness(aspects, slimmest)
        flat, flattest = ends.get("flatness", (1.0, 1.0))
        half_length = aspects * thickness / 2 * (1 + off)
        across = self._highest(bounds) * thickness / 2
        half_height = across / np.sqrt(flat)
        long, high = half_length.max(), half_height.max()
        if "incidence" in ends:
            long, high = turned_box(half_length, half_height, ends["incidence"])
        return 2 * float(long), 2 * float(across.max() * np.sqrt(flattest)), 2 * float(high)

    def _mean_thickness(self, aspect, betas):
        """Return 2 sqrt(w h) of bodies of volume pi/6, in arrays of NumPy or of JAX."""
        mu, weight = GAUSS
        bulk = 3 / 4 * weight @ ((1 - mu**2) * (1 + betas @ self._waves(mu)) ** 2)
        return (aspect * bulk) ** (-1 / 3)

    def _centroid(self, betas):
        """Return mu = cos t of the volume's centroid, in arrays of NumPy or of JAX."""
        mu, weight = GAUSS
        section = weight * (1 - mu**2) * (1 + betas @ self._waves(mu)) ** 2
        return section @ mu / section.sum(axis=-1)

    def _fullness(self, parameters, mu):
        """Return q = 1 + sum beta_k U_(k-1)(mu), and dq/dmu."""
        betas, waves = self.betas(parameters), self._waves(mu)
        slopes = np.array([chebyu(k - 1).deriv()(mu) for k in self.modes]).reshape(waves.shape)
        return 1 + betas @ waves, betas @ slopes

    def _waves(self, mu):
        """Return U_(k-1)(mu) of each sine mode."""
        return np.array([chebyu(k - 1)(mu) for k in self.modes]).reshape(-1, mu.size)
