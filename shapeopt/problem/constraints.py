"""Constraints on a body as numbers: ranges of its parameters, and margins not to be negative."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from surrogate.body.measures import chord, radii, thickness, thickness_at
from surrogate.arrays import AnyArray
from surrogate.body.family import LEAST_OPENING, opening


class Station(NamedTuple):
    """At x/c (0 the nose, 1 the tail) the body is at least ``thickness`` D thick."""

    x: float
    thickness: float


class Limits(NamedTuple):
    """All constraints as numbers; what is not bounded cannot be reached."""

    low: Float[AnyArray, " parameters"]
    high: Float[AnyArray, " parameters"]
    shift: Float[AnyArray, "cases parameters"]
    max_length: Float[AnyArray, ""]
    min_thickness: Float[AnyArray, ""]
    stations: Float[AnyArray, "stations 2"]
    min_radius: Float[AnyArray, ""]


@jax.jit
def margins(
    parameters: Float[AnyArray, " parameters"], limits: Limits
) -> Float[AnyArray, " constraints"]:
    """Every constraint as a number that must not be negative; the ranges are not among them."""
    openings = jax.vmap(lambda shift: opening(parameters + shift))(limits.shift)
    stations = jax.vmap(lambda s: thickness_at(parameters, s[0]) - s[1])(limits.stations)
    return jnp.concatenate(
        [
            jnp.min(openings, keepdims=True) - 2 * LEAST_OPENING,
            jnp.stack([limits.max_length - chord(parameters)]),
            jnp.stack([thickness(parameters) - limits.min_thickness]),
            stations,
            jnp.stack(radii(parameters)) - limits.min_radius,
        ]
    )


@jax.jit
def satisfied(
    bodies: Float[AnyArray, "bodies parameters"], limits: Limits
) -> Bool[Array, " bodies"]:
    """Which bodies meet every constraint."""
    inside = (bodies >= limits.low - 1e-9) & (bodies <= limits.high + 1e-9)
    room = jax.vmap(margins, in_axes=(0, None))(bodies, limits)
    return jnp.all(inside, axis=1) & jnp.all(room >= 0, axis=1)
