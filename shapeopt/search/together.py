"""Many bodies at once on the network: all draws ranked, the best moved together by Adam."""

from typing import Any

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float

from shapeopt.problem.constraints import Limits, margins, satisfied
from shapeopt.problem.objective import Scenarios, predicted
from surrogate.arrays import AnyArray

STEPS = 30
RATE = 0.04  # of a parameter's range
PENALTY = 100.0  # of a squared violation, in objectives


@jax.jit
def ranked(
    model: Any,
    bodies: Float[AnyArray, "bodies parameters"],
    limits: Limits,
    scenarios: Scenarios,
) -> Float[Array, " bodies"]:
    """Predicted objective of every body, infinite where a constraint is not met."""
    values = jax.vmap(predicted, in_axes=(None, 0, None))(model, bodies, scenarios)
    return jnp.where(satisfied(bodies, limits), values, jnp.inf)


@jax.jit
def descend_together(
    model: Any,
    starts: Float[AnyArray, "starts parameters"],
    limits: Limits,
    scenarios: Scenarios,
) -> tuple[Float[Array, "starts parameters"], Float[Array, " starts"]]:
    """A fixed number of projected Adam steps from all starts at once; violations are penalised.

    Returns the bodies and their penalised objectives.
    """
    adam = optax.adam(optax.cosine_decay_schedule(RATE, STEPS), b2=0.99)

    def loss(z):
        body = limits.low + limits.width * z
        violation = jnp.minimum(margins(body, limits), 0.0)
        return predicted(model, body, scenarios) * (1 + PENALTY * jnp.sum(violation**2))

    def step(carry, _):
        z, state = carry
        change, state = adam.update(jax.grad(loss)(z), state)
        return (jnp.clip(z + change, 0, 1), state), None

    def one(start):
        z = jnp.clip((start - limits.low) / limits.width, 0, 1)
        (z, _), _ = jax.lax.scan(step, (z, adam.init(z)), length=STEPS)
        return limits.low + limits.width * z, loss(z)

    return jax.vmap(one)(starts)


@jax.jit
def predicted_and_gradient(
    model: Any, parameters: Float[AnyArray, " parameters"], scenarios: Scenarios
) -> tuple[Float[Array, ""], Float[Array, " parameters"]]:
    """The predicted objective and its gradient."""
    return jax.value_and_grad(predicted, argnums=1)(model, parameters, scenarios)
