"""One body to be solved, whatever it came from: a function that draws its contour."""

import dataclasses
from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.contour import smooth_contour
from surrogate.body.form import PARAMETERS, Form, check_dimension
from surrogate.body.outline import check_body, family_markers
from surrogate.body.solid import Skin, half_axes, skin
from surrogate.checks import expect, finite_number
from surrogate.errors import InvalidInput

NODES = 400  # of the contour that a reach is measured on


@dataclasses.dataclass(frozen=True)
class Shape:
    """A body as a function from a number of nodes to its contour, at incidence and in place.

    In space the contour is the body's outline seen from the side. ``symmetric`` about the x axis.
    ``parameters`` are those of a family body, by name; its gradient can be had where it is
    symmetric.
    """

    draw: Callable[[int], np.ndarray]
    symmetric: bool
    parameters: Mapping[str, float] | None = None
    dimension: int = 2

    @property
    def form(self) -> Form:
        """What the numbers of a family body mean."""
        return Form(tuple(self.parameters), self.dimension)

    @property
    def values(self) -> Float[AnyArray, " parameters"]:
        """The parameters of a family body as an array."""
        return np.array(list(self.parameters.values()))

    def markers(self, nodes: int | tuple[int, int]) -> Float[AnyArray, "nodes 2"] | Skin:
        """What a flow takes: the contour, in space the skin."""
        if self.dimension == 2:
            return jnp.asarray(self.draw(nodes))
        return _skinned(self.values, self.form, nodes)

    @property
    def reach(self) -> Float[np.ndarray, " axes"]:
        """Sides in D of a box, centred on the origin, that holds the body."""
        sides = 2 * np.abs(self.draw(NODES)).max(axis=0)
        if self.dimension == 2:
            return sides
        _, width, height = half_axes(jnp.asarray(self.values), self.form)
        return np.array([sides[0], sides[1] * float(width / height), sides[1]])


def family_shape(
    parameters: Mapping[str, float], incidence: float = 0.0, dimension: int = 2
) -> Shape:
    """A body of the family by the names of its parameters, ``aspect`` first, nose up in degrees.

    In space without incidence.

    Raises:
      InvalidInput: the parameters describe no body, or the incidence is none.
    """
    expect("body", parameters, Mapping, "table of parameters, as {'aspect': 2}")
    if "aspect" not in parameters or (foreign := set(parameters) - set(PARAMETERS)):
        told = f"no parameter {foreign.pop()!r}" if "aspect" in parameters else "has no aspect"
        raise InvalidInput(f"body: {told}; {', '.join(PARAMETERS)}")
    named = {name: finite_number(name, value) for name, value in parameters.items()}
    named = {name: named[name] for name in PARAMETERS if name in named}
    dimension = check_dimension(dimension)
    check_body(named, dimension)
    turn = _incidence(incidence)
    if turn and dimension == 3:
        raise InvalidInput("incidence: bodies in space have none; their mirror planes lie along x")
    values, form = jnp.array(list(named.values())), Form(tuple(named), dimension)

    def draw(nodes):
        return np.asarray(rotate(_drawn(values, form, nodes), turn))

    return Shape(draw, turn == 0, named, dimension)


def contour_shape(
    points: Float[AnyArray, "points 2"], incidence: float = 0.0, keep_size: bool = False
) -> Shape:
    """A body by its contour, smoothed, scaled to area pi/4 unless its size is kept.

    Raises:
      InvalidInput: as ``smooth_contour``, or the incidence is none.
    """
    smooth_contour(points, 200, keep_size)
    turn = _incidence(incidence)

    def draw(nodes):
        return np.asarray(rotate(smooth_contour(points, nodes, keep_size), turn))

    return Shape(draw, symmetric=False)


def rotate(markers: Float[AnyArray, "nodes 2"], degrees: float) -> Float[AnyArray, "nodes 2"]:
    """Nose-up rotation about the origin: the angle of incidence in a stream along +x."""
    angle = np.deg2rad(degrees)
    c, s = np.cos(angle), np.sin(angle)
    return markers @ np.array([[c, -s], [s, c]])


_drawn = jax.jit(family_markers, static_argnames=("form", "nodes"))
_skinned = jax.jit(skin, static_argnames=("form", "nodes"))


def _incidence(degrees):
    degrees = finite_number("incidence", degrees)
    if not abs(degrees) <= 180:
        raise InvalidInput(f"incidence {degrees:g}: from -180 to 180 degrees")
    return degrees
