"""What is asked for: least drag at a Reynolds number, under constraints on the body."""

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from surrogate.body import LEAST_OPENING, Family, opening
from surrogate.errors import InvalidInput
from surrogate.scene import Scene

CANDIDATES = 2048


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

    def margins(self, parameters: Float[Array, "parameters"]) -> Float[Array, "constraints"]:
        """Every constraint as a number that must not be negative."""
        margins = [opening(parameters) - 2 * LEAST_OPENING]
        if self.max_length is not None:
            margins.append(self.max_length - chord(parameters))
        if self.min_thickness is not None:
            margins.append(thickness(parameters) - self.min_thickness)
        return jnp.stack(margins)

    def candidates(self) -> Float[np.ndarray, "bodies parameters"]:
        """Feasible bodies from all over the family.

        Raises:
          InvalidInput: there is none; the message names the constraints in conflict.
        """
        drawn = np.asarray(_everywhere(self.scene.family))
        feasible = drawn[np.asarray(_feasible(self, jnp.asarray(drawn)))]
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


def chord(parameters: Float[Array, "parameters"]) -> Float[Array, ""]:
    """Length of a family body along the stream, in D."""
    return jnp.sqrt(parameters[0])


def thickness(parameters: Float[Array, "parameters"]) -> Float[Array, ""]:
    """Greatest thickness of a family body across the stream, in D."""
    aspect, *betas = parameters
    t = np.linspace(0, np.pi, 181)
    y = np.sin(t) + sum(beta * np.sin(k * t) for k, beta in enumerate(betas, start=2))
    return jnp.max(y) / jnp.sqrt(aspect)


def _everywhere(family: Family) -> Float[Array, "bodies parameters"]:
    """Random members, the plain ellipses, and the corners' aspects among them."""
    drawn = family.sample(jax.random.key(0), CANDIDATES)
    low, high = family.aspect
    ellipses = np.zeros((33, drawn.shape[1]))
    ellipses[:, 0] = np.linspace(low, high, 33)
    inside = [family.contains(ellipse) for ellipse in ellipses]
    return jnp.concatenate([jnp.asarray(ellipses[inside]), drawn])


@functools.partial(jax.jit, static_argnums=0)
def _feasible(problem: Problem, bodies: Array) -> Bool[Array, "bodies"]:
    return jnp.all(jax.vmap(problem.margins)(bodies) >= 0, axis=1)
