"""What is asked for: least drag at a Reynolds number, under constraints on the body."""

import dataclasses
import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from surrogate.arrays import AnyArray
from surrogate.body import LEAST_OPENING, Family, opening
from surrogate.errors import InvalidInput
from surrogate.scene import Scene

CANDIDATES = 2048


class Limits(NamedTuple):
    """Bounds on a body, in D."""

    max_length: float
    min_thickness: float


@dataclasses.dataclass(frozen=True)
class Problem:
    """Minimise Cd at ``reynolds`` over the scene's family; the area is pi/4 by construction.

    ``max_length`` bounds the chord, ``min_thickness`` the greatest thickness, both in D.
    """

    scene: Scene
    reynolds: float
    max_length: float | None = None
    min_thickness: float | None = None

    def __post_init__(self):
        low, high = self.scene.reynolds
        if not low * (1 - 1e-9) <= self.reynolds <= high * (1 + 1e-9):
            raise InvalidInput(
                f"Reynolds number {self.reynolds:g}: the scene covers {low:g} to {high:g}"
            )
        for name in ("max_length", "min_thickness"):
            bound = getattr(self, name)
            if bound is not None and not (math.isfinite(bound) and bound > 0):
                raise InvalidInput(f"{name} {bound:g}: must be a finite length above 0, in D")

    @property
    def limits(self) -> Limits:
        """The bounds as numbers; what is not bounded cannot be reached."""
        longest = 100.0 if self.max_length is None else self.max_length
        return Limits(longest, self.min_thickness or 0.0)

    def candidates(self) -> Float[AnyArray, "bodies parameters"]:
        """Feasible bodies from all over the family.

        Raises:
          InvalidInput: there is none; the message names the constraints in conflict.
        """
        drawn = _everywhere(self.scene.family)
        feasible = drawn[np.asarray(_feasible(jnp.asarray(drawn), self.limits))]
        if not len(feasible):
            raise InvalidInput(self._conflict(drawn))
        return feasible

    def _conflict(self, drawn):
        lengths = jax.vmap(chord)(jnp.asarray(drawn))
        heights = jax.vmap(thickness)(jnp.asarray(drawn))
        if self.max_length is not None and float(lengths.min()) > self.max_length:
            return (
                f"max length {self.max_length:g}: every body of the family is longer than "
                f"{float(lengths.min()):.3g} D"
            )
        if self.min_thickness is not None and float(heights.max()) < self.min_thickness:
            return (
                f"min thickness {self.min_thickness:g}: every body of the family is thinner than "
                f"{float(heights.max()):.3g} D"
            )
        return (
            f"max length {self.max_length:g} and min thickness {self.min_thickness:g} contradict "
            "each other at this area; relax one of them"
        )


def margins(
    parameters: Float[AnyArray, " parameters"], limits: Limits
) -> Float[AnyArray, " constraints"]:
    """Every constraint as a number that must not be negative."""
    return jnp.stack(
        [
            opening(parameters) - 2 * LEAST_OPENING,
            limits.max_length - chord(parameters),
            thickness(parameters) - limits.min_thickness,
        ]
    )


def chord(parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, ""]:
    """Length of a family body along the stream, in D."""
    return jnp.sqrt(parameters[0])


def thickness(parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, ""]:
    """Greatest thickness of a family body across the stream, in D."""
    aspect, *betas = parameters
    t = np.linspace(0, np.pi, 181)
    y = np.sin(t) + sum(beta * np.sin(k * t) for k, beta in enumerate(betas, start=2))
    return jnp.max(y) / jnp.sqrt(aspect)


@functools.cache
def _everywhere(family: Family) -> Float[AnyArray, "bodies parameters"]:
    """Random members of the family, and its plain ellipses."""
    drawn = np.asarray(family.sample(jax.random.key(0), CANDIDATES))
    ellipses = np.zeros((33, drawn.shape[1]))
    ellipses[:, 0] = np.linspace(*family.aspect, 33)
    inside = [family.contains(ellipse) for ellipse in ellipses]
    return np.concatenate([ellipses[inside], drawn])


@jax.jit
def _feasible(bodies: Array, limits: Limits) -> Bool[AnyArray, " bodies"]:
    return jnp.all(jax.vmap(margins, in_axes=(0, None))(bodies, limits) >= 0, axis=1)
