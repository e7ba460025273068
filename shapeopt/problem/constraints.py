"""Constraints on a body as numbers: ranges of its parameters, and margins not to be negative."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from surrogate.arrays import AnyArray, Number
from surrogate.body.body_class import CLEAR_THICKNESS_RATIO, BodyClass
from surrogate.body.measures import least


class Station(NamedTuple):
    """At x/c (0 the nose, 1 the tail) the body is at least ``thickness`` D thick."""

    x: Number
    thickness: Number


class Limits(eqx.Module):
    """All constraints as numbers; what is not bounded cannot be reached.

    Of bounds on the thickness there is one or none: it holds all along the body, as a body of
    least drag under it meets it at several places.
    """

    low: Float[AnyArray, " parameters"]
    high: Float[AnyArray, " parameters"]
    shift: Float[AnyArray, "cases parameters"]
    max_length: Float[AnyArray, ""]
    min_thickness: Float[AnyArray, ""]
    max_thickness: Float[AnyArray, " bounds"]
    stations: Float[AnyArray, "stations 2"]
    min_radius: Float[AnyArray, ""]
    body_class: BodyClass = eqx.field(static=True)

    @property
    def width(self) -> Float[AnyArray, " parameters"]:
        """Of the ranges; what is fixed has next to none."""
        return jnp.maximum(self.high - self.low, 1e-12)


@jax.jit
def margins(
    parameters: Float[AnyArray, " parameters"], limits: Limits
) -> Float[AnyArray, " constraints"]:
    """Every constraint as a number that must not be negative; the ranges are not among them."""
    body = limits.body_class
    min_thickness_ratios = jax.vmap(lambda shift: body.min_thickness_ratio(parameters + shift))(
        limits.shift
    )
    stations = jax.vmap(lambda s: body.thickness_at(parameters, s[0]) - s[1])(limits.stations)
    return jnp.concatenate(
        [
            least(min_thickness_ratios)[None] - CLEAR_THICKNESS_RATIO,
            jnp.stack([limits.max_length - body.length(parameters)]),
            jnp.stack([body.thickness(parameters) - limits.min_thickness]),
            stations,
            (limits.max_thickness[:, None] - body.thicknesses(parameters)).ravel(),
            jnp.stack(body.radii(parameters)) - limits.min_radius,
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
