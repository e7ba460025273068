"""A family of bodies: ranges of their parameters, samples, the box that holds all of them."""

import dataclasses
import itertools
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from surrogate.arrays import AnyArray, Bodies, Body, Number
from surrogate.body.body_class import BodyClass, Range
from surrogate.body.drawing import body_markers, drawn_outline
from surrogate.body.incidence import reversal
from surrogate.body.parameters import PARAMETERS, Kind
from surrogate.body.registry import BODY_CLASSES, body_class, check_dimension
from surrogate.body.skin import Skin, SkinNodes
from surrogate.body.tables import bodies_of_table, body_of_table, is_of_arrays, wanted
from surrogate.body.validity import (
    CLEAR_THICKNESS_RATIO,
    are_valid,
    check_body,
    min_thickness_ratios,
)
from surrogate.checks import (
    expect,
    interval,
    real_numbers,
    shown,
    traced,
    transformed,
    whole_number,
)
from surrogate.errors import InvalidInput

SLACK = 1e-9  # of the ranges, for rounding
DECADE = 10  # a ratio of lengths whose ends are so far apart is drawn uniformly in its logarithm


@dataclasses.dataclass(frozen=True, init=False)
class Family:
    """A family of bodies: the range (low, high) of each parameter by name; all others are neutral.

    ``Family()`` has aspect and beta2 to beta4; ``Family(aspect=(1, 3), beta2=(-0.2, 0.2))`` two
    parameters; ``Family(aspect=(1.5, 6), gamma2=(-0.3, 0.3), incidence=(-4, 12))`` has camber and
    incidence, in degrees. ``Family(dimension=3)`` has a flatness as well, and 3-D bodies without
    one are bodies of revolution. Arrays of parameters are in the order of ``names``.
    """

    ranges: tuple[tuple[str, Range], ...]
    dimension: int

    def __init__(self, /, dimension: int = 2, **ranges: Range | Any):
        dimension = check_dimension(dimension)
        ranges = ranges or BODY_CLASSES[dimension].default_ranges
        names = body_class(ranges, dimension, "family").names
        if "aspect" not in names:
            raise InvalidInput("family: the aspect needs a range, as aspect = [1, 5]")
        ordered = tuple((name, _range(name, ranges[name])) for name in names)
        object.__setattr__(self, "ranges", ordered)
        object.__setattr__(self, "dimension", dimension)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of all arrays of parameters."""
        return tuple(name for name, _ in self.ranges)

    @property
    def body_class(self) -> BodyClass:
        """The class of its bodies, which defines their outline, markers and measures."""
        return BODY_CLASSES[self.dimension](self.names)

    @property
    def bounds(self) -> Float[np.ndarray, "parameters 2"]:
        """Least and greatest value of every parameter."""
        return np.array([ends for _, ends in self.ranges])

    @property
    def extent(self) -> tuple[float, ...]:
        """Length, (in 3-D width,) and height in D of a box around every body.

        The box is centred at the centroid.
        """
        with jax.ensure_compile_time_eval():
            return self.body_class.family_extent(self.bounds)

    @property
    def chord(self) -> float:
        """Chord in D of the ellipse of greatest aspect; in 2-D of all bodies of that aspect."""
        longest = self.ellipse(dict(self.ranges)["aspect"][1])
        with jax.ensure_compile_time_eval():
            return float(self.body_class.length(longest))

    @property
    def highest_mode(self) -> int:
        """Highest mode that some body has; 1 of ellipses."""
        return self.body_class.highest_mode(self.bounds)

    def markers(
        self, parameters: Float[AnyArray, " parameters"], nodes: int | SkinNodes
    ) -> Float[AnyArray, "nodes 2"] | Skin:
        """Return the surface of a body as it lies in the stream, its centroid at the origin.

        In 2-D the contour, clockwise from the nose; in 3-D the skin at (rings, azimuths).
        """
        return body_markers(self.body_class, parameters, nodes)

    def outline(
        self, parameters: Float[AnyArray, " parameters"], nodes: int
    ) -> Float[AnyArray, "nodes 2"]:
        """Return the contour of a body as it is drawn, at zero incidence: in 3-D its side view."""
        return drawn_outline(self.body_class, parameters, nodes)

    def ellipse(self, aspect: float) -> Float[np.ndarray, " parameters"]:
        """Return the parameters of an ellipse without modes.

        At aspect 1 it is a cylinder, in 3-D a sphere.
        """
        return self.body_class.ellipse(aspect)

    @property
    def has_lift(self) -> bool:
        """Whether bodies may have lift, as camber or incidence is among the parameters."""
        return not self.body_class.symmetric

    @property
    def round_body(self) -> str:
        """Name of the body of aspect 1 without modes: "cylinder", in 3-D "sphere"."""
        return self.body_class.round_body

    def named(self, parameters: AnyArray) -> dict[str, float]:
        """Return the parameters by name, for people and files."""
        return dict(zip(self.names, np.asarray(parameters, float).tolist(), strict=True))

    def parameters(self, named: Mapping[str, Number]) -> Float[AnyArray, " parameters"]:
        """Return the array of parameters given by name; those not named are neutral.

        JAX may trace the values.

        Raises:
          InvalidInput: a name is not the family's, the aspect is missing, or a value is not a
            number.
        """
        expect("body", named, Mapping, "table of parameters, as {'aspect': 2}")
        return body_of_table(self.names, named)

    def array(self, body: Bodies) -> Bodies:
        """Return tables of parameters as an array, and anything else as it is.

        Several bodies are a list of tables, or one table of arrays that broadcast as in NumPy.
        """
        if isinstance(body, Mapping) and is_of_arrays(body):
            return bodies_of_table(self.names, body)
        if isinstance(body, list | tuple) and body and all(isinstance(b, Mapping) for b in body):
            rows = [self.parameters(one) for one in body]
            return jnp.stack(rows) if traced(*rows) else np.array(rows)
        return self.parameters(body) if isinstance(body, Mapping) else body

    def sample(self, key: jax.Array, count: int) -> Float[AnyArray, "count parameters"]:
        """Return bodies drawn at random ``within`` the bounds, none of which crosses itself.

        Raises:
          InvalidInput: nearly all bodies in these bounds cross themselves.
        """
        count = whole_number("count", count, 0, 10**7)
        size, found, total = 4 * count + 64, [], 0
        for attempt in itertools.count():
            draw = key if attempt == 0 else jax.random.fold_in(key, attempt)
            shares = jax.random.uniform(draw, (size, len(self.names)))
            draws = self.within(np.asarray(shares))
            found.append(draws[self.clear(draws)])
            total += len(found[-1])
            if total >= count:
                return np.concatenate(found)[:count]

    def within(
        self, shares: Float[np.ndarray, "bodies parameters"]
    ) -> Float[np.ndarray, "bodies parameters"]:
        """Return the bodies whose parameters lie at these shares, from 0 to 1, of their ranges.

        For a length ratio whose range spans a decade or more it is a share of the range of its
        logarithm. Else 8 % of the bodies with aspects from 0.3 to 4 would be below 0.6, where
        drag depends on it most.
        """
        low, high = self.bounds.T
        ratios = np.isin(np.arange(len(low)), self.body_class.indices(Kind.RATIO))
        wide = ratios & (high >= DECADE * low)
        spread = np.where(wide, high / np.where(wide, low, 1.0), 1.0)
        return np.where(wide, low * spread**shares, low + (high - low) * shares)

    def symmetric_fore_and_aft(
        self, bodies: Float[np.ndarray, "bodies parameters"]
    ) -> Float[np.ndarray, "bodies parameters"]:
        """Return the bodies without their even sine modes; as they are if a range has no zero."""
        low, high = self.bounds.T
        even = reversal(self.body_class.parameters) < 0
        possible = np.all((low <= 0) & (high >= 0), where=even)
        return np.where(even & possible, 0.0, bodies)

    def clear(self, bodies: Float[AnyArray, "bodies parameters"]) -> Bool[np.ndarray, " bodies"]:
        """Return which bodies are so far from crossing themselves that they can be solved.

        Raises:
          InvalidInput: hardly any is.
        """
        clear = min_thickness_ratios(self.body_class, np.asarray(bodies)) > CLEAR_THICKNESS_RATIO
        if len(clear) > 64 * (1 + np.sum(clear)):
            raise InvalidInput("family: nearly all bodies in these bounds cross themselves")
        return clear

    def contains(self, parameters: AnyArray) -> bool:
        """Return whether a body lies within the ranges."""
        low, high = self.bounds.T
        return bool(np.all((parameters >= low - SLACK) & (parameters <= high + SLACK)))

    def check(self, parameters: Body) -> Float[np.ndarray, " parameters"]:
        """Check one body and return its parameters as floats.

        Raises:
          InvalidInput: they are not one number for every name, or describe no body.
        """
        values = self.numbers(parameters)
        check_body(self.body_class, values)
        return values

    def numbers(self, parameters: Body) -> Float[np.ndarray, " parameters"]:
        """Return the parameters of one body, an array or a table by name, as an array of floats.

        Raises:
          InvalidInput: they are not one number for every name.
        """
        parameters = self.array(parameters)
        if isinstance(parameters, str):
            raise InvalidInput(
                f"body {shown(parameters)}: flow.solve takes names of NACA sections; {self._wanted}"
            )
        if transformed(parameters):
            raise InvalidInput(
                "body: traced by JAX (in jit, vmap or grad), which drag and loads answer and this "
                "does not"
            )
        if (values := real_numbers(parameters)) is None:
            raise InvalidInput(
                f"body {shown(parameters)}: must be numbers, none masked, and a jax.numpy array "
                f"where they are traced; {self._wanted}"
            )
        self._refuse_contour(values)
        if values.ndim == 2:
            raise InvalidInput(
                f"body: a batch of {len(values)}, one is needed here; flow.solve_all(bodies, "
                "reynolds) and jax.vmap take batches"
            )
        if values.shape != (len(self.names),):
            raise InvalidInput(f"body: an array of shape {values.shape}; {self._wanted}")
        return values

    def check_all(self, bodies: Bodies) -> Float[np.ndarray, "bodies parameters"]:
        """Check many bodies and return their parameters as floats.

        Raises:
          InvalidInput: they are not one row a body, or one describes no body.
        """
        values = real_numbers(self.array(bodies))
        if values is None:
            raise InvalidInput(f"bodies: must be arrays of real numbers; of each {self._wanted}")
        self._refuse_contour(values)
        if values.ndim != 2 or values.shape[1] != len(self.names):
            raise InvalidInput(f"bodies: an array of shape {values.shape}; of each {self._wanted}")
        if not (valid := are_valid(self.body_class, values)).all():
            self.check(values[np.argmin(valid)])
        return values

    def _refuse_contour(self, values):
        if values.ndim == 2 and values.shape[1] == 2 != len(self.names):
            raise InvalidInput(
                f"body: {len(values)} points of a contour; flow.solve takes contour_shape(points)"
            )

    @property
    def _wanted(self):
        return wanted(self.names)


def _range(name, given):
    """Return the ends of a parameter's range, within its limits."""
    low, high = interval(f"range of {name}", given)
    least, most = PARAMETERS[name].widest_range
    if low == high:
        raise InvalidInput(f"range of {name}: {low:g} to {high:g}: low must be below high")
    if not least <= low <= high <= most:
        raise InvalidInput(f"range of {name} {low:g} to {high:g}: from {least:g} to {most:g}")
    return low, high
