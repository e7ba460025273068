"""Which parameters describe a body: finite, in their limits, of a contour that is simple."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from surrogate.arrays import AnyArray, padded
from surrogate.body.body_class import BodyClass
from surrogate.errors import InvalidInput

MIN_THICKNESS_RATIO = 0.02  # least local thickness ratio of a valid body
CLEAR_THICKNESS_RATIO = 2 * MIN_THICKNESS_RATIO  # that of samples and of optimised bodies


def check_body(body_class: BodyClass, parameters: Float[AnyArray, " parameters"]) -> None:
    """Raise InvalidInput unless the parameters describe a body of the class."""
    if not np.all(np.isfinite(parameters)):
        raise InvalidInput("body: every shape parameter must be a finite number")
    given = list(zip(body_class.parameters, np.asarray(parameters).tolist(), strict=True))
    for p, value in given:
        if p.bounded and not p.low <= value <= p.high:
            raise InvalidInput(
                f"{p.name} {value:g}: must lie between {p.low:g} and {p.high:g} ({p.meaning})"
            )
    if min_thickness_ratios(body_class, np.asarray(parameters)[None])[0] < MIN_THICKNESS_RATIO:
        modes = (f"{p.name} {value:g}" for p, value in given if value and not p.bounded)
        raise InvalidInput(
            f"body: {', '.join(modes)} make the contour cross or close on itself; "
            "smaller betas would not"
        )


def is_valid(body_class: BodyClass, parameters: Float[AnyArray, " parameters"]) -> Bool[Array, ""]:
    """Return whether ``check_body`` accepts a body; its parameters may be traced."""
    low, high = np.array([p.limits for p in body_class.parameters]).T
    sound = jnp.isfinite(parameters).all() & ((parameters >= low) & (parameters <= high)).all()
    return sound & (body_class.min_thickness_ratio(parameters) >= MIN_THICKNESS_RATIO)


def are_valid(
    body_class: BodyClass, bodies: Float[np.ndarray, "bodies parameters"]
) -> Bool[np.ndarray, " bodies"]:
    """Return which of many bodies ``check_body`` accepts."""
    return np.asarray(_are_valid(body_class, padded(bodies)))[: len(bodies)]


def min_thickness_ratios(
    body_class: BodyClass, bodies: Float[np.ndarray, "bodies parameters"]
) -> Float[np.ndarray, " bodies"]:
    """Return ``BodyClass.min_thickness_ratio`` of many bodies."""
    return np.asarray(_min_thickness_ratios(body_class, padded(bodies)))[: len(bodies)]


@functools.partial(jax.jit, static_argnums=0)
def _min_thickness_ratios(body_class, bodies):
    return jax.vmap(body_class.min_thickness_ratio)(bodies)


@functools.partial(jax.jit, static_argnums=0)
def _are_valid(body_class, bodies):
    return jax.vmap(lambda body: is_valid(body_class, body))(bodies)
