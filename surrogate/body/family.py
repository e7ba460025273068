"""The family of bodies, an ellipse with sine modes: the one place that knows its parameters.

    x = -(c/2) cos t,   y = b (sin t + beta2 sin 2t + beta3 sin 3t + ... + beta12 sin 12t),

c = sqrt(aspect) and b = 1 / (2 sqrt(aspect)), so the area is pi/4 whatever the parameters, in units
of the equivalent diameter D.
"""

import dataclasses
import itertools
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.special import eval_chebyu

from surrogate.arrays import AnyArray, Body
from surrogate.body.measures import least, moments
from surrogate.checks import interval
from surrogate.errors import InvalidInput

PARAMETERS = ("aspect", *(f"beta{k}" for k in range(2, 13)))
DEFAULT = {
    "aspect": (1.0, 5.0),
    "beta2": (-0.3, 0.3),
    "beta3": (-0.15, 0.2),
    "beta4": (-0.1, 0.1),
}
ASPECTS = (0.1, 20.0)  # length over thickness that the solver is tested for
LEAST_OPENING = 0.02  # thinnest y / (b sin t) a body may have
ROOMY = 2 * LEAST_OPENING  # that samples and optima keep
NODES = 128  # of the contours whose reach is measured
Range = tuple[float, float]


@dataclasses.dataclass(frozen=True, init=False)
class Family:
    """Ranges (low, high) of the parameters by name; ``aspect`` is one, betas not named are zero.

    ``Family()`` has aspect and beta2 to beta4; ``Family(aspect=(1, 3), beta2=(-0.2, 0.2))`` two
    parameters. Arrays of parameters are in the order of ``names``.
    """

    ranges: tuple[tuple[str, Range], ...]

    def __init__(self, /, **ranges: Range | Any):
        ranges = ranges or DEFAULT
        for name in ranges:
            if name not in PARAMETERS:
                raise InvalidInput(f"family: no parameter {name!r}; {PARAMETERS[0]}, beta2...12")
        if "aspect" not in ranges:
            raise InvalidInput("family: the aspect needs a range, as aspect = [1, 5]")
        ordered = [(n, interval(f"range of {n}", ranges[n])) for n in PARAMETERS if n in ranges]
        for name, (low, high) in ordered:
            if low == high:
                raise InvalidInput(f"range of {name}: {low:g} alone is none; leave a width")
        low, high = ordered[0][1]
        if not ASPECTS[0] <= low <= high <= ASPECTS[1]:
            raise InvalidInput(f"range of aspect {low:g} to {high:g}: from 0.1 to 20")
        if any(abs(end) > 1 for _, ends in ordered[1:] for end in ends):
            raise InvalidInput("family: the ranges of betas must lie between -1 and 1")
        object.__setattr__(self, "ranges", tuple(ordered))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters, in their order."""
        return tuple(name for name, _ in self.ranges)

    @property
    def modes(self) -> tuple[int, ...]:
        """Sine modes that the parameters behind the aspect weigh."""
        return modes_of(self.names)

    @property
    def bounds(self) -> Float[AnyArray, "parameters 2"]:
        return np.array([ends for _, ends in self.ranges])

    @property
    def extent(self) -> tuple[float, float]:
        """Length and height in D of a box, centred on the centroid, that holds every member."""
        low, high = self.bounds.T
        t = 2 * np.pi * np.arange(NODES) / NODES
        waves = np.sin(np.outer(self.modes, t))
        ends = [np.sin(t) + low[1:] @ np.minimum(waves, 0) + high[1:] @ np.maximum(waves, 0)]
        ends += [np.sin(t) + high[1:] @ np.minimum(waves, 0) + low[1:] @ np.maximum(waves, 0)]
        shifts = [dict(self.ranges).get("beta2", (0.0, 0.0))[k] for k in (0, 1)]
        with jax.ensure_compile_time_eval():
            longest = [family_markers(jnp.array([high[0], b]), (2,), NODES) for b in shifts]
            half_length = max(float(jnp.abs(markers[:, 0]).max()) for markers in longest)
        return (
            2 * half_length,
            float(np.abs(ends).max() / np.sqrt(low[0])),
        )

    def markers(
        self, parameters: Float[AnyArray, " parameters"], nodes: int
    ) -> Float[AnyArray, "nodes 2"]:
        """Contour of a member, clockwise from the nose, area centroid at the origin."""
        return family_markers(parameters, self.modes, nodes)

    def ellipse(self, aspect: float) -> Float[AnyArray, " parameters"]:
        """Parameters of a plain ellipse; of a cylinder at aspect 1."""
        return np.array([aspect] + [0.0] * len(self.modes))

    def named(self, parameters: AnyArray) -> dict[str, float]:
        """Parameters by name, for people and files."""
        return dict(zip(self.names, np.asarray(parameters, float).tolist(), strict=True))

    def parameters(self, named: Mapping[str, float]) -> Float[AnyArray, " parameters"]:
        """The array of parameters given by name; betas not named are zero.

        Raises:
          InvalidInput: a name is not the family's.
        """
        foreign = [name for name in named if name not in self.names and named[name]]
        if foreign:
            raise InvalidInput(
                f"body: {foreign[0]} is none of the family's {', '.join(self.names)}"
            )
        return np.array([float(named.get(name, 0.0)) for name in self.names])

    def sample(self, key: jax.Array, count: int) -> Float[AnyArray, "count parameters"]:
        """Uniform in the bounds; members that close on themselves are drawn again.

        Raises:
          InvalidInput: nearly all bodies in these bounds cross themselves.
        """
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
        keep = np.asarray(jax.vmap(lambda p: opening(p, self.modes))(jnp.asarray(bodies))) > ROOMY
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
        try:
            values = np.asarray(parameters)
        except ValueError:
            values = np.empty((), object)
        if values.dtype.kind not in "iuf":
            raise InvalidInput(f"body {parameters!r}: must be numbers, {self._wanted}")
        values = values.astype(float)
        if values.ndim == 2:
            raise InvalidInput(f"body: a batch of {len(values)}; jax.vmap takes batches, one here")
        if values.shape != (len(self.names),):
            raise InvalidInput(f"body: an array of shape {values.shape}; {self._wanted}")
        check_body(self.named(values))
        return values

    @property
    def _wanted(self):
        return f"{len(self.names)} parameters are needed: {', '.join(self.names)}"


def modes_of(names: tuple[str, ...]) -> tuple[int, ...]:
    """Sine modes of the parameters behind the aspect."""
    return tuple(int(name.removeprefix("beta")) for name in names[1:])


def describe(name: str) -> str:
    """What a parameter does to a body, for a person."""
    beta = f"\N{GREEK SMALL LETTER BETA}{name.removeprefix('beta')}"
    known = {
        "aspect": "Aspect, length to thickness",
        "beta2": f"Fuller fore or aft, {beta}",
        "beta3": f"Blunt or pointed ends, {beta}",
        "beta4": f"Finer fore and aft, {beta}",
    }
    return known.get(name, f"Waves of the contour, {beta}")


def smooth(parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, " parameters"]:
    """Coordinates of a body in which its drag varies smoothly: the aspect counts by its log."""
    return jnp.asarray(parameters).at[0].set(jnp.log(parameters[0]))


def opening(
    parameters: Float[AnyArray, " parameters"], modes: tuple[int, ...]
) -> Float[AnyArray, ""]:
    """Least y / (b sin t) over the body: it crosses itself where this is not positive."""
    c = np.cos(np.linspace(0, np.pi, 181))  # sin kt / sin t is a Chebyshev polynomial of cos t
    waves = np.array([eval_chebyu(k - 1, c) for k in modes]).reshape(len(modes), c.size)
    return least(1 + jnp.asarray(parameters)[1:] @ waves)


def family_markers(
    parameters: Float[AnyArray, " parameters"], modes: tuple[int, ...], nodes: int
) -> Float[AnyArray, "nodes 2"]:
    """Contour of a body, clockwise from the nose, area centroid at the origin."""
    aspect, *betas = parameters
    t = 2 * np.pi * np.arange(nodes) / nodes
    half_length, half_height = jnp.sqrt(aspect) / 2, 1 / (2 * jnp.sqrt(aspect))
    y = np.sin(t) + sum(beta * np.sin(k * t) for k, beta in zip(modes, betas, strict=True))
    markers = jnp.stack([-half_length * np.cos(t), half_height * y], axis=1)
    return markers - jnp.array([moments(markers)[1][0], 0.0])


def check_body(named: Mapping[str, float]) -> None:
    """Raise InvalidInput unless the named parameters describe a body."""
    values = np.array(list(named.values()), float)
    if not np.all(np.isfinite(values)):
        raise InvalidInput("body: every shape parameter must be a finite number")
    if not ASPECTS[0] <= values[0] <= ASPECTS[1]:
        raise InvalidInput(
            f"aspect {values[0]:g}: must lie between 0.1 and 20 (length / thickness)"
        )
    if float(opening(values, modes_of(tuple(named)))) < LEAST_OPENING:
        bent = ", ".join(f"{name} {value:g}" for name, value in named.items() if value)
        raise InvalidInput(
            f"body: {bent} make the contour cross or close on itself; smaller betas would not"
        )
