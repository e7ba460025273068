"""One body to be solved, whatever it came from: a function that draws its contour."""

import dataclasses
from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.contour import smooth_contour
from surrogate.body.family import check_body, family_markers, modes_of
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput


@dataclasses.dataclass(frozen=True)
class Shape:
    """A body as a function from a number of nodes to its contour, at incidence and in place.

    ``symmetric`` about the x axis. ``parameters`` are those of a family body, by name; its
    gradient can be had where it is symmetric.
    """

    draw: Callable[[int], np.ndarray]
    symmetric: bool
    parameters: Mapping[str, float] | None = None


def family_shape(parameters: Mapping[str, float], incidence: float = 0.0) -> Shape:
    """A body of the family by the names of its parameters, ``aspect`` first, nose up in degrees.

    Raises:
      InvalidInput: the parameters describe no body, or the incidence is none.
    """
    named = {name: finite_number(name, value) for name, value in parameters.items()}
    check_body(named)
    turn = _incidence(incidence)
    values, modes = jnp.array(list(named.values())), modes_of(tuple(named))

    def draw(nodes):
        return np.asarray(rotate(_drawn(values, modes, nodes), turn))

    return Shape(draw, turn == 0, named)


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


_drawn = jax.jit(family_markers, static_argnames=("modes", "nodes"))


def _incidence(degrees):
    degrees = finite_number("incidence", degrees)
    if not abs(degrees) <= 180:
        raise InvalidInput(f"incidence {degrees:g}: from -180 to 180 degrees")
    return degrees
