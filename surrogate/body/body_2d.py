"""Bodies in 2-D: contours of area pi/4, with c = sqrt(aspect) and b = 1 / (2 sqrt(aspect))."""

import dataclasses
from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.body_class import NODES, BodyClass, Range
from surrogate.body.drawing import drawn_outline
from surrogate.body.extent import cambered_extent
from surrogate.body.measures import moments
from surrogate.body.parameters import PARAMETERS


@dataclasses.dataclass(frozen=True)
class Body2D(BodyClass):
    """The class of 2-D bodies, measured per unit span."""

    dimension = 2
    available = tuple(name for name in PARAMETERS if name != "flatness")
    default_ranges: ClassVar[Mapping[str, Range]] = {
        "aspect": (1.0, 5.0),
        "beta2": (-0.3, 0.3),
        "beta3": (-0.15, 0.2),
        "beta4": (-0.1, 0.1),
    }
    round_body = "cylinder"
    size = "area pi/4"

    def half_axes(
        self, parameters: Float[AnyArray, " parameters"]
    ) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Return (c / 2, b), the half axes in D of the ellipse before the modes are added."""
        root = jnp.sqrt(self.aspect(parameters))
        return root / 2, 1 / (2 * root)

    def outline(
        self, parameters: Float[AnyArray, " parameters"], nodes: int
    ) -> Float[Array, "nodes 2"]:
        """Return the contour at zero incidence, clockwise from the nose, centroid at the origin."""
        t, y = self._profile(parameters, nodes)
        half_length, half_height = self.half_axes(parameters)
        markers = jnp.stack([-half_length * np.cos(t), half_height * y], axis=1)
        _, (x, y) = moments(markers)
        return markers - jnp.array([x, y if self.camber_modes else 0.0])

    def markers(
        self, parameters: Float[AnyArray, " parameters"], nodes: int
    ) -> Float[Array, "nodes 2"]:
        """Return the contour as it lies in the stream, at the body's incidence."""
        return self.contour(parameters, nodes)

    def extent(
        self, parameters: Float[AnyArray, " parameters"], contour: Float[AnyArray, "nodes 2"]
    ) -> Float[np.ndarray, "2"]:
        """Return length and height in D of a box, centred at the origin, around the contour."""
        return 2 * np.abs(contour).max(axis=0)

    def family_extent(self, bounds: Float[np.ndarray, "parameters 2"]) -> tuple[float, float]:
        """Return length and height in D of a box, centred at the origin, around every body.

        For symmetric bodies the length follows from the ends of beta2, which moves the centroid.
        """
        ends = dict(zip(self.names, bounds, strict=True))
        if not self.symmetric:
            return cambered_extent(ends)
        simple, (shortest, longest) = Body2D(("aspect", "beta2")), ends["aspect"]
        outlines = [
            np.asarray(drawn_outline(simple, np.array([longest, beta]), NODES))
            for beta in ends.get("beta2", (0.0, 0.0))
        ]
        half_length = max(float(np.abs(outline[:, 0]).max()) for outline in outlines)
        return 2 * half_length, self._highest(bounds) / np.sqrt(shortest)
