"""The search: every start at once by projected Adam, the best of them by SLSQP."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import minimize, nnls

from shapeopt.problem.constraints import Limits, margins, satisfied
from shapeopt.problem.objective import Scenarios, predicted
from surrogate.arrays import AnyArray
from surrogate.model.network import DragNetwork

STEPS = 60  # of the first stage
RATE = 0.03  # of a parameter's range
PENALTY = 100.0  # of a squared violation, in objectives
ACTIVE = 1e-5  # a constraint with less room than this counts as met with equality

ValueAndGradient = Callable[[np.ndarray], tuple[float, np.ndarray]]


class Found(NamedTuple):
    """Where SLSQP ended, whether within the constraints; ``kkt_residual`` as the function."""

    parameters: Float[AnyArray, " parameters"]
    value: float
    evaluations: int
    kkt_residual: float
    feasible: bool
    converged: bool
    path: Float[AnyArray, "steps parameters"]


def descend(
    value_and_gradient: ValueAndGradient,
    limits: Limits,
    start: Float[AnyArray, " parameters"],
    tolerance: float = 1e-9,
) -> Found:
    """SLSQP (Kraft 1988) in parameters scaled to [0, 1]."""
    low, width = limits.low, np.maximum(limits.high - limits.low, 1e-12)
    path, last = [start], {}

    def scaled(z):
        value, gradient = value_and_gradient(low + width * z)
        last.update(z=z.copy(), gradient=gradient * width, calls=last.get("calls", 0) + 1)
        return value, gradient * width

    def room(z):
        value, jacobian = _margins(low + width * z, limits)
        return np.asarray(value), np.asarray(jacobian) * width

    result = minimize(
        scaled,
        np.clip((start - low) / width, 0, 1),
        jac=True,
        method="SLSQP",
        bounds=[(0, 1)] * len(low),
        constraints={
            "type": "ineq",
            "fun": lambda z: room(z)[0],
            "jac": lambda z: room(z)[1],
        },
        callback=lambda z: path.append(low + width * z),
        options={"ftol": tolerance, "maxiter": 100},
    )
    z = np.clip(result.x, 0, 1)
    value, gradient = float(result.fun), last["gradient"]
    if not np.array_equal(z, last["z"]):
        value, gradient = scaled(z)
    space, jacobian = room(z)
    feasible = bool(np.all(space >= -1e-6))
    return Found(
        parameters=low + width * z,
        value=float(value),
        evaluations=last["calls"],
        kkt_residual=kkt_residual(z, value, gradient, space, jacobian),
        feasible=feasible,
        converged=bool(result.success) and feasible and bool(np.isfinite(value)),
        path=np.array(path),
    )


def kkt_residual(
    z: Float[np.ndarray, " parameters"],
    value: float,
    gradient: Float[np.ndarray, " parameters"],
    room: Float[np.ndarray, " constraints"],
    jacobian: Float[np.ndarray, "constraints parameters"],
) -> float:
    """What of the gradient no active constraint holds: |g - J^T m| / |f|, least over m >= 0.

    ``z`` are parameters over their ranges, so the residual is the relative change of the
    objective per range of a parameter; it vanishes at a local optimum (Karush-Kuhn-Tucker).
    """
    normals = [jacobian[room < ACTIVE], np.eye(z.size)[z < ACTIVE], -np.eye(z.size)[1 - z < ACTIVE]]
    active = np.concatenate(normals).T
    left = nnls(active, gradient)[1] if active.shape[1] else float(np.linalg.norm(gradient))
    return float(left / abs(value))


@jax.jit
def ranked(
    network: DragNetwork,
    bodies: Float[AnyArray, "bodies parameters"],
    limits: Limits,
    scenarios: Scenarios,
) -> Float[Array, " bodies"]:
    """Predicted objective of every body, infinite where a constraint is not met."""
    values = jax.vmap(predicted, in_axes=(None, 0, None))(network, bodies, scenarios)
    return jnp.where(satisfied(bodies, limits), values, jnp.inf)


@jax.jit
def descend_together(
    network: DragNetwork,
    starts: Float[AnyArray, "starts parameters"],
    limits: Limits,
    scenarios: Scenarios,
) -> tuple[Float[Array, "starts parameters"], Float[Array, " starts"]]:
    """A fixed number of projected Adam steps from all starts at once; violations are penalised.

    Returns the bodies and their penalised objectives.
    """
    width = limits.high - limits.low

    def loss(z):
        body = limits.low + width * z
        violation = jnp.minimum(margins(body, limits), 0.0)
        return predicted(network, body, scenarios) * (1 + PENALTY * jnp.sum(violation**2))

    def step(carry, k):
        z, mean, square = carry
        gradient = jax.grad(loss)(z)
        mean, square = 0.9 * mean + 0.1 * gradient, 0.99 * square + 0.01 * gradient**2
        unbiased = mean / (1 - 0.9 ** (k + 1)), square / (1 - 0.99 ** (k + 1))
        rate = RATE * (1 + jnp.cos(jnp.pi * k / STEPS)) / 2
        change = rate * unbiased[0] / (jnp.sqrt(unbiased[1]) + 1e-12)
        return (jnp.clip(z - change, 0, 1), mean, square), None

    def one(start):
        z = jnp.clip((start - limits.low) / jnp.maximum(width, 1e-12), 0, 1)
        zero = jnp.zeros_like(z)
        (z, _, _), _ = jax.lax.scan(step, (z, zero, zero), jnp.arange(STEPS, dtype=float))
        return limits.low + width * z, loss(z)

    return jax.vmap(one)(starts)


@jax.jit
def predicted_and_gradient(
    network: DragNetwork, parameters: Float[AnyArray, " parameters"], scenarios: Scenarios
) -> tuple[Float[Array, ""], Float[Array, " parameters"]]:
    """The predicted objective and its gradient."""
    return jax.value_and_grad(predicted, argnums=1)(network, parameters, scenarios)


@jax.jit
def _margins(parameters, limits):
    return margins(parameters, limits), jax.jacfwd(margins)(parameters, limits)
