"""One body to be solved, whatever it came from."""

import dataclasses
import functools
from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.body_class import BodyClass
from surrogate.body.contour import contour_curve, contour_length, highest_harmonic, smoothed
from surrogate.body.drawing import body_markers, drawn_contour
from surrogate.body.incidence import check_incidence, rotate
from surrogate.body.nose import nose_of_contour
from surrogate.body.registry import body_class
from surrogate.body.skin import Skin, SkinNodes
from surrogate.body.validity import check_body
from surrogate.checks import expect, finite_number
from surrogate.errors import InvalidInput

NODES = 400  # of the contour that an extent is measured on
NOSE_NODES = 2000  # of the one that a nose is measured on, which may be a thousandth of a D


@dataclasses.dataclass(frozen=True)
class Shape:
    """A 2-D body given by a function from a number of nodes to its contour, at incidence.

    ``symmetric`` says whether the body is known to be symmetric about the x axis. ``parameters``
    are those of a family body by name, None for other bodies. ``length`` is the chord in D where it
    is known, as contours turned by their incidence do not show it. ``incidence`` is in degrees,
    nose up.
    """

    draw: Callable[[int], np.ndarray]
    symmetric: bool
    parameters: Mapping[str, float] | None = None
    length: float | None = None
    incidence: float = 0.0

    @property
    def dimension(self) -> int:
        """Number of space dimensions, 2."""
        return 2

    def differentiable(self) -> "FamilyShape":
        """Return the body as one whose loads have gradients in all of its parameters.

        Raises:
          InvalidInput: it has no parameters.
        """
        raise InvalidInput("gradient: is for bodies of the family, given by parameters")

    @functools.cached_property
    def chord(self) -> float:
        """Chord in D: length from nose to tail along x at zero incidence.

        A contour has that of the points it was given by, before corners are rounded. The flow at
        U c / nu = R is that at Re = U D / nu = R / chord.
        """
        return float(np.ptp(self.contour[:, 0])) if self.length is None else self.length

    @functools.cached_property
    def nose(self) -> float:
        """Radius of curvature in D that the thinnest boundary layer follows."""
        return nose_of_contour(self.draw(NOSE_NODES), self.chord)

    @functools.cached_property
    def highest_mode(self) -> int:
        """Highest harmonic of the contour whose waves matter, of a family body its highest mode."""
        return highest_harmonic(self.contour)

    @property
    def height(self) -> float:
        """Largest side in D, across the stream, of the box around the body as it lies."""
        return float(self.extent[1:].max())

    def markers(self, nodes: int) -> Float[AnyArray, "nodes 2"] | Skin:
        """Return the surface as the flow solver takes it: the contour."""
        return jnp.asarray(self.draw(nodes))

    @functools.cached_property
    def extent(self) -> Float[np.ndarray, " axes"]:
        """Sides in D of a box, centred at the origin, that holds the body."""
        return 2 * np.abs(self.contour).max(axis=0)

    @functools.cached_property
    def contour(self) -> Float[np.ndarray, "nodes 2"]:
        """The contour as the body lies, in 3-D in the side view, that lengths are measured on."""
        return self.draw(NODES)


@dataclasses.dataclass(frozen=True, kw_only=True)
class FamilyShape(Shape):
    """A body of a family, in 2-D or 3-D; ``draw`` gives its contour in the side view.

    ``symmetric`` says whether its camber and incidence are all zero.
    """

    parameters: Mapping[str, float]
    body_class: BodyClass

    def differentiable(self) -> "FamilyShape":
        """Return the body as one whose loads have gradients in all of its parameters.

        Where camber or incidence is among them it is not taken for symmetric, even if they are 0,
        since the gradients of lift and moment are not.
        """
        symmetric = self.symmetric and self.body_class.symmetric
        return dataclasses.replace(self, symmetric=symmetric)

    @functools.cached_property
    def highest_mode(self) -> int:
        """Highest mode that is not zero; 1 of an ellipse."""
        return self.body_class.highest_mode(self.values)

    @property
    def values(self) -> Float[np.ndarray, " parameters"]:
        """Values of the parameters as an array."""
        return np.array(list(self.parameters.values()))

    @property
    def dimension(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return self.body_class.dimension

    def markers(self, nodes: int | SkinNodes) -> Float[AnyArray, "nodes 2"] | Skin:
        """Return the surface as the flow solver takes it: in 2-D the contour, in 3-D the skin."""
        return body_markers(self.body_class, self.values, nodes)

    @functools.cached_property
    def chord(self) -> float:
        """Chord in D: length from nose to tail along x at zero incidence."""
        return float(self.body_class.length(self.values))

    @property
    def chord_slopes(self) -> dict[str, float]:
        """Derivatives of the chord in D by the parameters."""
        slopes = np.asarray(jax.grad(self.body_class.length)(self.values)).tolist()
        return dict(zip(self.parameters, slopes, strict=True))

    @functools.cached_property
    def extent(self) -> Float[np.ndarray, " axes"]:
        """Sides in D of a box, centred at the origin, that holds the body as it lies."""
        return self.body_class.extent(self.values, self.contour)


def family_shape(
    parameters: Mapping[str, float], incidence: float | None = None, dimension: int = 2
) -> FamilyShape:
    """Return the body with these parameters by name, ``aspect`` among them.

    Args:
      parameters: those that are not named are neutral: modes and incidence 0, flatness 1.
      incidence: in degrees, nose up, if it is not among the parameters.
      dimension: 2 or 3.

    Raises:
      InvalidInput: the parameters describe no body, or it cannot have this incidence.
    """
    expect("body", parameters, Mapping, "table of parameters, as {'aspect': 2}")
    if incidence is not None and "incidence" in parameters:
        raise InvalidInput("incidence: is given among the parameters and apart; once is enough")
    if angle := check_incidence(0.0 if incidence is None else incidence):
        parameters = {**parameters, "incidence": angle}
    kind = body_class(parameters, dimension)
    if "aspect" not in parameters:
        raise InvalidInput(f"body: has no aspect; {', '.join(kind.available)}")
    named = {name: finite_number(name, parameters[name]) for name in kind.names}
    values = np.array(list(named.values()))
    check_body(kind, values)
    draw = functools.partial(_draw_family_body, kind, values)
    return FamilyShape(
        draw,
        kind.is_symmetric(values),
        parameters=named,
        incidence=named.get("incidence", 0.0),
        body_class=kind,
    )


def contour_shape(
    points: Float[AnyArray, "points 2"], incidence: float = 0.0, keep_size: bool = False
) -> Shape:
    """Return the 2-D body with this contour, smoothed, scaled to area pi/4 unless its size is kept.

    Args:
      points: x and y once around, in order.
      incidence: in degrees, nose up.
      keep_size: keep the area that was given.

    Raises:
      InvalidInput: as ``contour_curve``, or the incidence is not from -180 to 180 degrees.
    """
    curve, incidence = contour_curve(points, keep_size), check_incidence(incidence)
    draw = functools.partial(_draw_contour, curve, keep_size, incidence)
    length = contour_length(points, keep_size)
    return Shape(draw, symmetric=False, length=length, incidence=incidence)


def _draw_family_body(body_class, parameters, nodes):
    return np.asarray(drawn_contour(body_class, parameters, nodes))


def _draw_contour(curve, keep_size, incidence, nodes):
    return rotate(smoothed(curve, nodes, keep_size), incidence)
