"""Compliances dy/da that are kept, and solved again only where the traction has moved away."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from surrogate.flow import steady
from surrogate.flow.domain import Domain
from surrogate.flow.steady import Case, FlowState
from surrogate.flow.tangent import Cost, Effort, compliance
from surrogate.training.physics import Physics


class Kept(NamedTuple):
    """Compliances of samples, and the tractions that they were solved at."""

    matrix: Float[Array, "*samples modes modes"]
    seat: Float[Array, "*samples modes"]


def oseen_compliances(physics: Physics) -> Kept:
    """S G B of every sample: exact as Re -> 0, and free once the sample is prepared."""

    def one(case):
        return jax.vmap(case.body.slip)(case.response).T + steady.pinning(physics.domain, case)

    return Kept(jax.lax.map(one, physics.cases), physics.oseen.amplitude)


def kept_compliance(
    domain: Domain, case: Case, state: FlowState, kept: Kept, lag: float, effort: Effort
) -> tuple[Kept, Cost]:
    """The kept compliance within ``lag`` of its traction (relative), a solved one beyond.

    Solving costs one tangent solve per mode; lag 0 solves always, infinity never.
    """
    free = Cost(jnp.array(0), jnp.array(True))
    if math.isinf(lag):
        return kept, free

    def solved() -> tuple[Kept, Cost]:
        matrix, cost = compliance(domain, case, state, effort)
        return Kept(matrix, state.amplitude), cost

    return jax.lax.cond(
        drifted(kept, state.amplitude, lag),
        solved,
        lambda: (kept, free),
    )


def drifted(kept: Kept, amplitude: Float[Array, " modes"], lag: float) -> Bool[Array, ""]:
    """Whether a traction lies ``lag`` or more away from where the compliance was solved."""
    away = jnp.linalg.norm(amplitude - kept.seat)
    return ~(away < lag * jnp.linalg.norm(kept.seat))
