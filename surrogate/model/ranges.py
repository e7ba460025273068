"""The ranges that a surrogate was trained in: the one rule for extrapolation."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.incidence import descriptions
from surrogate.body.parameters import INCIDENCE
from surrogate.scene.scene import Scene

# By which a value may exceed its range, relative to its width plus 1: single precision is enough.
ROUNDING = 1e-6


@dataclasses.dataclass(frozen=True)
class TrainedRanges:
    """The ranges of a scene's shape parameters and of log Re.

    A body is inside them where one of its descriptions is, or one of its mirror image's, since
    networks have the symmetries of the flow. The last axis of all arrays is (parameters, log Re),
    as in ``names``; leading axes of bodies and Reynolds numbers broadcast.
    """

    scene: Scene

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the shape parameters, and "log Re"."""
        return (*self.scene.family.names, "log Re")

    @property
    def bounds(self) -> Float[np.ndarray, "inputs 2"]:
        """Least and greatest value of every shape parameter and of log Re."""
        return np.concatenate([self.scene.family.bounds, np.log([self.scene.reynolds])])

    @property
    def slack(self) -> Float[np.ndarray, " inputs"]:
        """Tolerance for rounding, by which a value may lie outside its range."""
        low, high = self.bounds.T
        return ROUNDING * (high - low + 1)

    @property
    def descriptions(
        self,
    ) -> tuple[Float[np.ndarray, "rows parameters"], Float[np.ndarray, "rows parameters"]]:
        """Signs and offsets of all descriptions of a body, a row for each, its own first."""
        body_class = self.scene.family.body_class
        signs, offsets = descriptions(body_class.parameters, body_class.dimension)
        low, high = dict(zip(self.names, self.bounds, strict=True)).get(INCIDENCE.name, (0.0, 0.0))
        if -low > high:  # then a body is the same with 180 degrees less rather than more
            offsets = -offsets
        one = slice(1) if body_class.symmetric else slice(None)  # it is its own mirror image
        return signs[one], offsets[one]

    @functools.partial(jax.jit, static_argnums=0)
    def excess(
        self, parameters: Float[AnyArray, "*bodies parameters"], reynolds: Float[AnyArray, "*cases"]
    ) -> Float[Array, "*batch inputs"]:
        """Return how far each value lies outside its range; 0 inside, up to rounding.

        Of the descriptions of a body none of whose values is outside where the given one is inside
        it is the one that lies nearest to the ranges, by the sum of distances in range widths.
        """
        parameters = jnp.asarray(parameters, float)

        def excess_of(sign, offset):
            return self._excess(self._values(sign * parameters + offset, reynolds))

        every = jax.vmap(excess_of)(*self.descriptions)
        low, high = self.bounds.T
        distance = jnp.sum(every / jnp.where(high > low, high - low, 1.0), axis=-1, keepdims=True)
        fewer = jnp.all((every == 0) | (every[:1] != 0), axis=-1, keepdims=True)
        distance = jnp.where(fewer, distance, jnp.inf)
        nearest = jnp.argmin(distance, axis=0, keepdims=True)  # the first of equals
        return jnp.take_along_axis(every, nearest, axis=0)[0]

    def outside(
        self, parameters: Float[AnyArray, "*bodies parameters"], reynolds: Float[AnyArray, "*cases"]
    ) -> str:
        """Return in words which values lie outside their ranges, of each the farthest; else ""."""
        excess = np.asarray(self.excess(parameters, reynolds))
        if not excess.any():
            return ""
        values, words = np.asarray(self._values(parameters, reynolds)), []
        *batch, size = values.shape
        for k in np.flatnonzero(excess.reshape(-1, size).any(axis=0)):
            index = np.unravel_index(np.argmax(excess[..., k]), batch)
            name, numbers = self.names[k], np.array([values[(*index, k)], *self.bounds[k]])
            if name == "log Re":
                name, numbers = "Reynolds number", np.exp(numbers)
            value, low, high = numbers.tolist()
            where = f" at index {', '.join(map(str, index))}" if batch else ""
            words.append(f"{name} {value:.10g}{where} (trained from {low:g} to {high:g})")
        return ", ".join(words)

    def _excess(self, values):
        low, high = self.bounds.T
        distance = jnp.maximum(low - values, values - high)
        # NaN for NaN: a comparison with it is false
        return jnp.where(distance <= self.slack, 0.0, distance)

    def _values(self, parameters, reynolds):
        parameters, logs = jnp.asarray(parameters, float), jnp.log(jnp.asarray(reynolds, float))
        shape = jnp.broadcast_shapes(parameters.shape[:-1], logs.shape)
        parts = parameters, logs[..., None]
        return jnp.concatenate([jnp.broadcast_to(p, (*shape, p.shape[-1])) for p in parts], axis=-1)
