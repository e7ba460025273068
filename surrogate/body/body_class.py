"""The interface of a class of bodies: everything that is drawn, measured or checked on a body.

Bodies of one class have the same named parameters. In 2-D and 3-D alike their side view is

    x = -(c/2) cos t,   y = b (sin t + beta2 sin 2t + ... + beta12 sin 12t
                                     - gamma2 cos 2t - ... - gamma6 cos 6t),

t = 0 at the nose and pi at the tail. The half axes c/2 and b follow from the ratios (aspect, ...)
such that the area (2-D) or the volume (3-D) is that of the cylinder or sphere of diameter D = 1.
The camber line -b sum gamma_k cos kt is a polynomial in x, so that thickness and area are those
without it; it is for 2-D bodies. The incidence turns a body nose up in its side view.
"""

import abc
import dataclasses
import functools
from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from scipy.special import eval_chebyu

from surrogate.arrays import AnyArray, array_module, picked
from surrogate.body.incidence import rotate
from surrogate.body.measures import ANGLES, SIDES, Radii, least
from surrogate.body.parameters import PARAMETERS, Kind, Parameter, keep_mirror_plane
from surrogate.body.skin import Skin, SkinNodes

NODES = 128  # of the contours that a family's extent is measured on
Range = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class BodyClass(abc.ABC):
    """A class of bodies, whose parameters have these names and are in this order in arrays.

    Instances are hashable, so that they can be static arguments of ``jax.jit``. All lengths are in
    D. Everything that takes one body's parameters can be traced.
    """

    names: tuple[str, ...]

    dimension: ClassVar[int]
    available: ClassVar[tuple[str, ...]]
    default_ranges: ClassVar[Mapping[str, Range]]
    round_body: ClassVar[str]  # what the ellipse of aspect 1 is called
    size: ClassVar[str]  # what all bodies have in common

    def replaced(
        self, parameters: Float[AnyArray, "*bodies parameters"], name: str, values: AnyArray | float
    ) -> Float[AnyArray, "*all parameters"]:
        """Return parameters with other values of one of them; bodies and values broadcast."""
        module = array_module(parameters, values)
        here = np.arange(len(self.names)) == self.names.index(name)
        return module.where(here, module.asarray(values)[..., None], parameters)

    @abc.abstractmethod
    def half_axes(
        self, parameters: Float[AnyArray, " parameters"]
    ) -> tuple[Float[AnyArray, ""], ...]:
        """Return the half axes in D before the modes are added: length, (in 3-D width,) height."""

    @abc.abstractmethod
    def outline(
        self, parameters: Float[AnyArray, " parameters"], nodes: int
    ) -> Float[AnyArray, "nodes 2"]:
        """Return the contour in the side view at zero incidence, as it is drawn and measured.

        Clockwise from the nose, the body's centroid at the origin.
        """

    @abc.abstractmethod
    def markers(
        self, parameters: Float[AnyArray, " parameters"], nodes: int | SkinNodes
    ) -> Float[AnyArray, "nodes 2"] | Skin:
        """Return the surface as the body lies in the stream: the contour, or in 3-D the skin."""

    @abc.abstractmethod
    def extent(
        self, parameters: Float[AnyArray, " parameters"], contour: Float[AnyArray, "nodes 2"]
    ) -> Float[np.ndarray, " axes"]:
        """Return the sides in D of a box, centred at the origin, around a body.

        Args:
          parameters: of one body.
          contour: of its side view, as it lies in the stream.
        """

    @abc.abstractmethod
    def family_extent(self, bounds: Float[np.ndarray, "parameters 2"]) -> tuple[float, ...]:
        """Return the sides in D of a box, centred at the origin, around all bodies in bounds."""

    def contour(
        self, parameters: Float[AnyArray, " parameters"], nodes: int
    ) -> Float[AnyArray, "nodes 2"]:
        """Return the contour of the side view as the body lies in the stream, at its incidence."""
        outline = self.outline(parameters, nodes)
        if "incidence" not in self.names:
            return outline
        return rotate(outline, picked(parameters, self.names.index("incidence")))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Meaning and limits of each parameter, in the order of ``names``."""
        return tuple(PARAMETERS[name] for name in self.names)

    def indices(self, kind: Kind) -> Int[np.ndarray, " of_kind"]:
        """Return the indices of the parameters of one kind in an array of all parameters."""
        found = [index for index, p in enumerate(self.parameters) if p.kind is kind]
        return np.array(found, int)

    @property
    def modes(self) -> tuple[int, ...]:
        """Wave numbers k of the sine modes sin kt."""
        return self._modes_of(Kind.SINE)

    @property
    def camber_modes(self) -> tuple[int, ...]:
        """Wave numbers k of the camber's cosine modes cos kt."""
        return self._modes_of(Kind.CAMBER)

    def highest_mode(self, values: Float[AnyArray, "parameters ..."]) -> int:
        """Return the highest k of the sine and cosine modes that are not zero; 1 if all are.

        Args:
          values: of the parameters of one body, or of several along further axes.
        """
        given = zip(self.parameters, np.asarray(values), strict=True)
        return max([1, *(p.mode for p, value in given if p.mode and np.any(value))])

    @property
    def symmetric(self) -> bool:
        """Whether all bodies of the class are symmetric about y = 0, in 3-D z = 0.

        They are if the class has no camber and no incidence.
        """
        return keep_mirror_plane(self.names)

    def is_symmetric(self, parameters: Float[AnyArray, " parameters"]) -> bool:
        """Return whether one body is symmetric about y = 0, in 3-D z = 0, by its own parameters.

        Others of its class may be different.
        """
        given = zip(self.parameters, np.asarray(parameters).tolist(), strict=True)
        return all(p.keeps_mirror_plane or value == 0 for p, value in given)

    def aspect(self, parameters: Float[AnyArray, "*bodies parameters"]) -> Float[Array, "*bodies"]:
        """Return the aspect: length over thickness of the ellipse before the modes are added."""
        return picked(parameters, self.names.index("aspect"))

    def flatness(self, parameters: Float[AnyArray, " parameters"]) -> Float[Array, ""]:
        """Return the flatness: width over height; 1 for classes without this parameter."""
        if "flatness" not in self.names:
            return jnp.ones(())
        return picked(parameters, self.names.index("flatness"))

    def betas(self, parameters: Float[AnyArray, " parameters"]) -> Float[Array, " betas"]:
        """Return the coefficients beta_k of the sine modes."""
        return picked(parameters, self.indices(Kind.SINE))

    def gammas(self, parameters: Float[AnyArray, " parameters"]) -> Float[Array, " gammas"]:
        """Return the coefficients gamma_k of the camber's cosine modes."""
        return picked(parameters, self.indices(Kind.CAMBER))

    @functools.partial(jax.jit, static_argnums=0, inline=True)
    def smooth(self, parameters: Float[AnyArray, " parameters"]) -> Float[Array, " parameters"]:
        """Return the parameters with the logarithms of all ratios: drag varies smoothly in them."""
        values, ratios = jnp.asarray(parameters), self.indices(Kind.RATIO)
        return values.at[ratios].set(jnp.log(values[ratios]))

    def ellipse(self, aspect: float) -> Float[np.ndarray, " parameters"]:
        """Return the parameters of an ellipse without modes, in 3-D of one of revolution."""
        return np.array([aspect if p.name == "aspect" else p.neutral for p in self.parameters])

    @functools.partial(jax.jit, static_argnums=0, inline=True)
    def length(self, parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, ""]:
        """Return the chord in D: the length along the stream at zero incidence."""
        return 2 * self.half_axes(parameters)[0]

    def thickness(self, parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, ""]:
        """Return the greatest thickness in D across the chord, in 3-D the height."""
        return 2 * -least(-self._height(parameters, ANGLES))

    def thicknesses(
        self, parameters: Float[AnyArray, " parameters"]
    ) -> Float[AnyArray, " stations"]:
        """Return the thickness in D at every second degree of t from 20 to 160 degrees.

        Between them a body is thicker by at most 1 - cos(k degrees) of the amplitude of its mode k:
        by 0.02 % with the usual modes up to 4, by 0.3 % with one of 12.
        """
        return 2 * self._height(parameters, SIDES)

    def thickness_at(
        self, parameters: Float[AnyArray, " parameters"], station: Float[AnyArray, ""]
    ) -> Float[AnyArray, ""]:
        """Return the thickness in D at x/c = ``station``: 0 is the nose, 1 the tail."""
        return 2 * self._height(parameters, jnp.arccos(1 - 2 * station))

    def camber(self, parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, ""]:
        """Return the greatest height in D of the camber line above or below the chord."""
        return -least(-self.cambers(parameters))

    def cambers(self, parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, " stations"]:
        """Return the height in D of the camber line above the chord, then its depth below it.

        The chord is the straight line from the nose to the tail, the height across the x axis. Each
        is at every second degree of t from 2 to 178.
        """
        t = ANGLES[2:-1:2]
        above = jnp.zeros(t.size)
        for k, gamma in zip(self.camber_modes, self.gammas(parameters), strict=True):
            chord = np.cos(t) if k % 2 else 1.0  # the wave's value at the ends, joined
            above += self.half_axes(parameters)[-1] * gamma * (chord - np.cos(k * t))
        return jnp.concatenate([above, -above])

    def radii(self, parameters: Float[AnyArray, " parameters"]) -> Radii:
        """Return the radii of curvature |r'|^3 / |x' y'' - y' x''| of the outline, in D.

        The outline may be convex or concave. The radius between the ends is the least one of both
        sides.
        """
        half = self.length(parameters) / 2

        def curvature(t):
            x1, x2 = half * np.sin(t), half * np.cos(t)
            y1, y2 = (
                self._height(parameters, t, order) + self._camber(parameters, t, order)
                for order in (1, 2)
            )
            return jnp.abs(x1 * y2 - y1 * x2) / jnp.sqrt(x1**2 + y1**2 + 1e-12) ** 3

        sides = [ANGLES[1:-1]] if self.symmetric else [ANGLES[1:-1], -ANGLES[1:-1]]
        sharpest = -least(-jnp.concatenate([curvature(t) for t in sides]))
        nose, tail = self._height(parameters, ANGLES[[0, -1]], 1) ** 2 / half
        return Radii(nose, tail, 1 / sharpest)

    def min_thickness_ratio(
        self, parameters: Float[AnyArray, " parameters"]
    ) -> Float[AnyArray, ""]:
        """Return the least ratio of the local thickness to that of the plain ellipse.

        A body with a ratio below 0 crosses itself.
        """
        c = np.cos(np.linspace(0, np.pi, 181))  # sin kt / sin t is a Chebyshev polynomial of cos t
        waves = np.array([eval_chebyu(k - 1, c) for k in self.modes]).reshape(-1, c.size)
        return least(1 + self.betas(parameters) @ waves)

    def _modes_of(self, kind):
        return tuple(p.mode for p in self.parameters if p.kind is kind and p.mode is not None)

    def _profile(self, parameters, nodes):
        """Return t and y / b at the nodes of a contour."""
        t = contour_angles(nodes)
        waves = zip(self.modes, self.betas(parameters), strict=True)
        camber = zip(self.camber_modes, self.gammas(parameters), strict=True)
        y = np.sin(t) + sum(beta * np.sin(k * t) for k, beta in waves)
        return t, y - sum(gamma * np.cos(k * t) for k, gamma in camber)

    def _height(self, parameters, t, derivative=0):
        """Return y(t) without camber, half the thickness, or a derivative of it."""
        phase = derivative * np.pi / 2
        waves = zip((1, *self.modes), (1.0, *self.betas(parameters)), strict=True)
        half_height = self.half_axes(parameters)[-1]
        return half_height * sum(beta * k**derivative * jnp.sin(k * t + phase) for k, beta in waves)

    def _camber(self, parameters, t, derivative):
        """Return the camber line over t up to a constant, or a derivative of it."""
        phase = derivative * np.pi / 2
        waves = zip(self.camber_modes, self.gammas(parameters), strict=True)
        slopes = (gamma * k**derivative * jnp.cos(k * t + phase) for k, gamma in waves)
        return -self.half_axes(parameters)[-1] * sum(slopes)

    def _highest(self, bounds):
        """Return the greatest |y| / b of the symmetric bodies within the bounds."""
        low, high = bounds[self.indices(Kind.SINE)].T
        t = contour_angles(NODES)
        waves = np.sin(np.outer(self.modes, t))
        upper = np.sin(t) + low @ np.minimum(waves, 0) + high @ np.maximum(waves, 0)
        lower = np.sin(t) + high @ np.minimum(waves, 0) + low @ np.maximum(waves, 0)
        return float(np.abs([upper, lower]).max())


def contour_angles(nodes: int) -> Float[np.ndarray, " nodes"]:
    """Return equidistant angles t in radians, once around a contour from the nose."""
    return 2 * np.pi * np.arange(nodes) / nodes
