"""Bodies: the default symmetric family, and any closed contour as markers at equidistant t."""

import dataclasses
import itertools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.special import eval_chebyu

from surrogate.arrays import AnyArray
from surrogate.errors import InvalidInput

AREA = np.pi / 4  # of every body unless its size is kept: the equivalent diameter D is 1
PARAMETERS = ("aspect", "beta2", "beta3", "beta4")
LEAST_OPENING = 0.02  # thinnest y / (b sin t) a family body may have


@dataclasses.dataclass(frozen=True)
class Family:
    """Bounds (low, high) of the default family's parameters.

    x = -(c/2) cos t,  y = b (sin t + beta2 sin 2t + beta3 sin 3t + beta4 sin 4t), with
    c = sqrt(aspect) and b = 1 / (2 sqrt(aspect)), so the area is pi/4 whatever the parameters.
    """

    aspect: tuple[float, float] = (1.0, 5.0)
    beta2: tuple[float, float] = (-0.3, 0.3)
    beta3: tuple[float, float] = (-0.15, 0.2)
    beta4: tuple[float, float] = (-0.1, 0.1)

    @property
    def bounds(self) -> Float[AnyArray, "parameters 2"]:
        return np.array([getattr(self, name) for name in PARAMETERS])

    @property
    def extent(self) -> tuple[float, float]:
        """Length and height in D of a box, centred on the centroid, that holds every member."""
        corners = [
            np.abs(family_markers(jnp.array(corner), 128)).max(axis=0)
            for corner in itertools.product(*self.bounds)
        ]
        length, height = 2 * np.max(corners, axis=0)
        return float(length), float(height)

    def sample(self, key: jax.Array, count: int) -> Float[AnyArray, "count parameters"]:
        """Uniform in the bounds; members that close on themselves are drawn again."""
        low, high = self.bounds.T
        draws = jax.random.uniform(key, (4 * count + 64, len(low)), minval=low, maxval=high)
        valid = draws[np.asarray(jax.vmap(opening)(draws)) > 2 * LEAST_OPENING]
        if len(valid) < count:
            raise InvalidInput("family: nearly all bodies in these bounds cross themselves")
        return valid[:count]

    def contains(self, parameters: Float[AnyArray, " parameters"]) -> bool:
        low, high = self.bounds.T
        slack = 1e-9
        return bool(np.all((parameters >= low - slack) & (parameters <= high + slack)))


@dataclasses.dataclass(frozen=True)
class Shape:
    """A body as a function from a number of nodes to its contour, at incidence and in place.

    ``parameters`` are those of a family body; ``symmetric`` about the x axis.
    """

    draw: Callable[[int], np.ndarray]
    symmetric: bool
    parameters: tuple[float, ...] | None = None


def family_shape(parameters: AnyArray, incidence: float = 0.0) -> Shape:
    """A family body, nose up by ``incidence`` degrees.

    Raises:
      InvalidInput: the parameters describe no body.
    """
    check_family(parameters)
    values = jnp.asarray(parameters, float)

    def draw(nodes):
        return np.asarray(rotate(family_markers(values, nodes), incidence))

    return Shape(draw, incidence == 0, tuple(values.tolist()))


def ellipse(aspect: float) -> Float[AnyArray, " parameters"]:
    """Parameters of a plain ellipse; of a cylinder at aspect 1."""
    return np.array([aspect] + [0.0] * (len(PARAMETERS) - 1))


def opening(parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, ""]:
    """Least y / (b sin t) over the body: it crosses itself where this is not positive."""
    c = np.cos(np.linspace(0, np.pi, 181))  # sin kt / sin t is a Chebyshev polynomial of cos t
    modes = np.stack([eval_chebyu(k - 1, c) for k in range(2, len(PARAMETERS) + 1)])
    return jnp.min(1 + parameters[1:] @ modes)


def family_markers(
    parameters: Float[AnyArray, " parameters"], nodes: int
) -> Float[AnyArray, "nodes 2"]:
    """Contour of a family body, clockwise from the nose, area centroid at the origin."""
    aspect, *betas = parameters
    t = 2 * np.pi * np.arange(nodes) / nodes
    half_length, half_height = jnp.sqrt(aspect) / 2, 1 / (2 * jnp.sqrt(aspect))
    y = np.sin(t) + sum(beta * np.sin(k * t) for k, beta in enumerate(betas, start=2))
    markers = jnp.stack([-half_length * np.cos(t), half_height * y], axis=1)
    return markers - jnp.array([_centroid(markers)[0], 0.0])


def check_family(parameters: AnyArray) -> None:
    """Raise InvalidInput unless the parameters describe a body."""
    values = np.asarray(parameters, float)
    if not np.all(np.isfinite(values)):
        raise InvalidInput("body: every shape parameter must be a finite number")
    if not 0.1 <= values[0] <= 20:
        raise InvalidInput(
            f"aspect {values[0]:g}: must lie between 0.1 and 20 (length / thickness)"
        )
    least = float(opening(jnp.asarray(values)))
    if least < LEAST_OPENING:
        raise InvalidInput(
            f"body: beta2 to beta4 = {', '.join(f'{v:g}' for v in values[1:])} make the contour "
            "cross or close on itself; smaller values would not"
        )


def moments(
    markers: Float[AnyArray, "nodes 2"],
) -> tuple[Float[AnyArray, ""], Float[AnyArray, " 2"]]:
    """Signed area (positive when clockwise) and area centroid of a polygon."""
    following = jnp.roll(markers, -1, axis=0)
    cross = markers[:, 1] * following[:, 0] - markers[:, 0] * following[:, 1]
    area = jnp.sum(cross) / 2
    return area, jnp.sum((markers + following) * cross[:, None], axis=0) / (6 * area)


def _centroid(markers):
    return moments(markers)[1]


def rotate(markers: Float[AnyArray, "nodes 2"], degrees: float) -> Float[AnyArray, "nodes 2"]:
    """Nose-up rotation about the origin: the angle of incidence in a stream along +x."""
    angle = np.deg2rad(degrees)
    c, s = np.cos(angle), np.sin(angle)
    return markers @ jnp.array([[c, -s], [s, c]])
