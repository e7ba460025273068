"""The family of bodies: ranges of the parameters of an outline, samples, the box that holds all."""

import dataclasses
import itertools
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import lsq_linear
from scipy.special import eval_chebyu

from surrogate.arrays import AnyArray, Body
from surrogate.body.form import PARAMETERS, Form, check_dimension
from surrogate.body.outline import (
    MIN_THICKNESS_RATIO,
    check_body,
    family_markers,
    limits,
    min_thickness_ratios,
)
from surrogate.body.solid import GAUSS, Skin, centre, half_axes, skin
from surrogate.checks import expect, finite_number, interval, real_numbers, shown, whole_number
from surrogate.errors import InvalidInput

BETAS = {"beta2": (-0.3, 0.3), "beta3": (-0.15, 0.2), "beta4": (-0.1, 0.1)}
DEFAULT = {
    2: {"aspect": (1.0, 5.0), **BETAS},
    3: {"aspect": (0.7, 4.0), "flatness": (1.0, 2.0), **BETAS},
}
CLEAR_THICKNESS_RATIO = 2 * MIN_THICKNESS_RATIO  # that samples and optima keep
NODES = 128  # of the contours whose reach is measured
Range = tuple[float, float]


@dataclasses.dataclass(frozen=True, init=False)
class Family:
    """Ranges (low, high) of the parameters by name; ``aspect`` is one, betas not named are zero.

    ``Family()`` has aspect and beta2 to beta4; ``Family(aspect=(1, 3), beta2=(-0.2, 0.2))`` two
    parameters; ``Family(dimension=3)`` has a flatness as well, and without one are bodies of
    revolution. Arrays of parameters are in the order of ``names``.
    """

    ranges: tuple[tuple[str, Range], ...]
    dimension: int

    def __init__(self, /, dimension: int = 2, **ranges: Range | Any):
        dimension = check_dimension(dimension)
        ranges = ranges or DEFAULT[dimension]
        for name in ranges:
            if name not in PARAMETERS:
                raise InvalidInput(f"family: no parameter {name!r}; {', '.join(PARAMETERS)}")
        if "flatness" in ranges and dimension == 2:
            raise InvalidInput("family: flatness is of bodies in space, dimension = 3")
        if "aspect" not in ranges:
            raise InvalidInput("family: the aspect needs a range, as aspect = [1, 5]")
        ordered = [(n, interval(f"range of {n}", ranges[n])) for n in PARAMETERS if n in ranges]
        for name, (low, high) in ordered:
            if low == high:
                raise InvalidInput(f"range of {name}: {low:g} alone is none; leave a width")
            least, most = limits(name)
            if not least <= low <= high <= most:
                raise InvalidInput(
                    f"range of {name} {low:g} to {high:g}: from {least:g} to {most:g}"
                )
        object.__setattr__(self, "ranges", tuple(ordered))
        object.__setattr__(self, "dimension", dimension)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters, in their order."""
        return tuple(name for name, _ in self.ranges)

    @property
    def form(self) -> Form:
        """What the numbers of its bodies mean."""
        return Form(self.names, self.dimension)

    @property
    def bounds(self) -> Float[AnyArray, "parameters 2"]:
        return np.array([ends for _, ends in self.ranges])

    @property
    def extent(self) -> tuple[float, ...]:
        """Length and height, in space length, width and height, in D, of a box for every member.

        It is centred on the centroid.
        """
        low, high = self.bounds[self.form.ratios :].T
        t = 2 * np.pi * np.arange(NODES) / NODES
        waves = np.sin(np.outer(self.form.modes, t))
        ends = [np.sin(t) + low @ np.minimum(waves, 0) + high @ np.maximum(waves, 0)]
        ends += [np.sin(t) + high @ np.minimum(waves, 0) + low @ np.maximum(waves, 0)]
        highest = float(np.abs(ends).max())
        with jax.ensure_compile_time_eval():
            if self.dimension == 3:
                return self._extent_in_space(low, high, highest)
            longest, shifts = self.bounds[0, 1], dict(self.ranges).get("beta2", (0.0, 0.0))
            form = Form(("aspect", "beta2"))
            ends = [family_markers(jnp.array([longest, b]), form, NODES) for b in shifts]
            half_length = max(float(jnp.abs(markers[:, 0]).max()) for markers in ends)
        return 2 * half_length, highest / np.sqrt(self.bounds[0, 0])

    def _extent_in_space(self, low, high, highest):
        """By the least bulk that betas can have, and the centroids of the extreme ones."""
        mu, weight = GAUSS
        root = np.sqrt(weight * (1 - mu**2))
        waves = np.array([root * eval_chebyu(k - 1, mu) for k in self.form.modes])
        betas = np.zeros(0)
        if len(low):
            betas = lsq_linear(waves.T, -root, (low, high), tol=1e-12).x
        ratios = dict(self.ranges)
        flat, flattest = ratios.get("flatness", (1.0, 1.0))
        corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
        off = float(jnp.abs(jax.vmap(self._centre)(jnp.asarray(corners))).max())
        longest, tallest = (
            half_axes(jnp.array([end, 1.0, *betas]), self._full) for end in self.bounds[0, ::-1]
        )
        across = 2 * highest * float(tallest[1])
        return (
            2 * float(longest[0]) * (1 + off),
            across * float(np.sqrt(flattest)),
            across / float(np.sqrt(flat)),
        )

    @property
    def _full(self):
        betas = self.names[self.form.ratios :]
        return Form(("aspect", "flatness", *betas), 3)

    def _centre(self, betas):
        return centre(jnp.concatenate([jnp.ones(2), betas]), self._full)

    def markers(
        self, parameters: Float[AnyArray, " parameters"], nodes: int | tuple[int, int]
    ) -> Float[AnyArray, "nodes 2"] | Skin:
        """Contour of a member, clockwise from the nose, area centroid at the origin.

        In space its skin, at ``nodes`` rings and azimuths.
        """
        if self.dimension == 3:
            return skin(jnp.asarray(parameters), self.form, nodes)
        return family_markers(parameters, self.form, nodes)

    def outline(
        self, parameters: Float[AnyArray, " parameters"], nodes: int
    ) -> Float[AnyArray, "nodes 2"]:
        """Contour of a member as it is drawn: in space as seen from the side."""
        return family_markers(parameters, self.form, nodes)

    def ellipse(self, aspect: float) -> Float[AnyArray, " parameters"]:
        """Parameters of a plain ellipse; of a cylinder, in space a sphere, at aspect 1."""
        return np.array([aspect] + [1.0] * (self.form.ratios - 1) + [0.0] * len(self.form.modes))

    @property
    def round_body(self) -> str:
        """What its ellipse of aspect 1 is called."""
        return "cylinder" if self.dimension == 2 else "sphere"

    def named(self, parameters: AnyArray) -> dict[str, float]:
        """Parameters by name, for people and files."""
        return dict(zip(self.names, np.asarray(parameters, float).tolist(), strict=True))

    def parameters(self, named: Mapping[str, float]) -> Float[AnyArray, " parameters"]:
        """The array of parameters given by name; betas not named are zero, flatness 1.

        Raises:
          InvalidInput: a name is not the family's, the aspect is missing, or a value is no number.
        """
        expect("body", named, Mapping, "table of parameters, as {'aspect': 2}")
        if "aspect" not in named:
            raise InvalidInput(f"body: has no aspect; {self._wanted}")
        values = {name: finite_number(name, value) for name, value in named.items()}
        usual = {"flatness": 1.0}
        foreign = [n for n in values if n not in self.names and values[n] != usual.get(n, 0.0)]
        if foreign:
            raise InvalidInput(
                f"body: {foreign[0]} is none of the family's {', '.join(self.names)}"
            )
        return np.array([values.get(n, usual.get(n, 0.0)) for n in self.names])

    def sample(self, key: jax.Array, count: int) -> Float[AnyArray, "count parameters"]:
        """Uniform in the bounds; members that close on themselves are drawn again.

        Raises:
          InvalidInput: nearly all bodies in these bounds cross themselves.
        """
        count = whole_number("count", count, 0, 10**7)
        low, high = self.bounds.T
        size, found, total = 4 * count + 64, [], 0
        for attempt in itertools.count():
            draw = key if attempt == 0 else jax.random.fold_in(key, attempt)
            draws = jax.random.uniform(draw, (size, len(low)), minval=low, maxval=high)
            found.append(draws[self.opened(draws)])
            total += len(found[-1])
            if total >= count:
                return jnp.concatenate(found)[:count]

    def opened(self, bodies: Float[AnyArray, "bodies parameters"]) -> Bool[np.ndarray, " bodies"]:
        """Which of many bodies keep so far from crossing themselves that they are solved.

        Raises:
          InvalidInput: hardly any does.
        """
        keep = min_thickness_ratios(np.asarray(bodies), self.form) > CLEAR_THICKNESS_RATIO
        if len(keep) > 64 * (1 + np.sum(keep)):
            raise InvalidInput("family: nearly all bodies in these bounds cross themselves")
        return keep

    def contains(self, parameters: AnyArray) -> bool:
        """Whether a body lies within the ranges."""
        low, high = self.bounds.T
        slack = 1e-9
        return bool(np.all((parameters >= low - slack) & (parameters <= high + slack)))

    def check(self, parameters: Body) -> Float[np.ndarray, " parameters"]:
        """The parameters of one body, in whatever kind of numbers they came.

        Raises:
          InvalidInput: they are not as many numbers as the family has, or describe no body.
        """
        values = self.numbers(parameters)
        check_body(self.named(values), self.dimension)
        return values

    def numbers(self, parameters: Body) -> Float[np.ndarray, " parameters"]:
        """As many numbers as the family has parameters, in whatever kind they came.

        Raises:
          InvalidInput: they are none.
        """
        if (values := real_numbers(parameters)) is None:
            raise InvalidInput(
                f"body {shown(parameters)}: must be numbers, none masked, and a jax.numpy array "
                f"where they are traced; {self._wanted}"
            )
        if values.ndim == 2:
            raise InvalidInput(f"body: a batch of {len(values)}; jax.vmap takes batches, one here")
        if values.shape != (len(self.names),):
            raise InvalidInput(f"body: an array of shape {values.shape}; {self._wanted}")
        return values

    def check_all(
        self, bodies: Float[AnyArray, "bodies parameters"]
    ) -> Float[np.ndarray, "bodies parameters"]:
        """The same of many bodies, each of which must be one.

        Raises:
          InvalidInput: they are not as many numbers as the family has, or one describes no body.
        """
        values = real_numbers(bodies)
        if values is None:
            raise InvalidInput(f"bodies: must be arrays of real numbers; of each {self._wanted}")
        if values.ndim != 2 or values.shape[1] != len(self.names):
            raise InvalidInput(f"bodies: an array of shape {values.shape}; of each {self._wanted}")
        least = min_thickness_ratios(values, self.form)
        ends = np.array([limits(name) for name in self.names[: self.form.ratios]]).T
        ratios = values[:, : self.form.ratios]
        sound = np.isfinite(values).all(axis=1) & (least >= MIN_THICKNESS_RATIO)
        sound &= ((ratios >= ends[0]) & (ratios <= ends[1])).all(axis=1)
        if (bad := ~sound).any():
            self.check(values[np.argmax(bad)])
        return values

    @property
    def _wanted(self):
        return f"{len(self.names)} parameters are needed: {', '.join(self.names)}"


def describe(name: str) -> str:
    """What a parameter does to a body, for a person."""
    beta = f"\N{GREEK SMALL LETTER BETA}{name.removeprefix('beta')}"
    known = {
        "aspect": "Aspect, length to thickness",
        "flatness": "Flatness, width to height",
        "beta2": f"Fuller fore or aft, {beta}",
        "beta3": f"Blunt or pointed ends, {beta}",
        "beta4": f"Finer fore and aft, {beta}",
    }
    return known.get(name, f"Waves of the contour, {beta}")
