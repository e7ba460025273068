"""Half-inverse gradients: the physics Jacobian of a batch, inverted half way.

With J = d(y, goal row)/d(weights) stacked over the batch and scaled by 1/sqrt(B), J = U S V^T,
the update is -eta V S^(-1/2) U^T y / sqrt(B); singular values below tau S_max are dropped.
Schnell, Holl, Thuerey 2022 (Half-Inverse Gradients for Physical Deep Learning).
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from surrogate.flow import steady
from surrogate.flow.newton import NewtonSettings
from surrogate.flow.steady import FlowState
from surrogate.flow.tangent import Effort, compliance
from surrogate.training.method import Method, Progress, keep, per_sample, predict


def half_inverse_gradients(
    batch: int = 24,
    eta: float = 1.0,
    decay: float = 60.0,
    tau: float = 1e-3,
    goal: float = 3.0,
    leave_out: bool = True,
    settings: NewtonSettings = NewtonSettings(1e-4, 10, 40),
    effort: Effort = Effort(1e-2, 30),
) -> Method:
    """HIG: one forced flow and one tangent solve per mode and sample; flows must converge.

    A sample whose flow or tangents fail is left out of the step and restarts from its Oseen flow
    (``leave_out``; without it only numbers that are not finite are).
    """

    def init(network, physics):
        return physics.oseen.velocity, jnp.array(0)

    def outputs(physics, index, amplitude, flow):
        domain, case = physics.domain, physics.case(index)
        velocity, info = steady.forced_flow(domain, case, amplitude, flow, settings)
        state = FlowState(velocity, amplitude)
        slip = steady.slip_residual(domain, case, state)
        matrix, spent = compliance(domain, case, state, effort)
        drag = 2 * jnp.abs(physics.oseen.amplitude[index, 0])
        row = jnp.zeros_like(slip).at[0].set(2 * goal / drag)  # lambda dy/da, exactly
        miss = row @ jnp.linalg.solve(matrix, slip)
        y = jnp.append(slip, miss)
        jacobian = jnp.concatenate([matrix, row[None]])
        finite = jnp.all(jnp.isfinite(jacobian)) & jnp.all(jnp.isfinite(y))
        valid = finite & (info.converged & spent.converged | (not leave_out))
        return y, jacobian, velocity, valid, info.products + spent.products

    def update(network, state, physics, batch, done):
        flows, iteration = state
        y, physical, solved, valid, products = per_sample(
            lambda i, a, u: outputs(physics, i, a, u),
            batch,
            predict(network, physics, batch),
            flows[batch],
        )
        mask = valid[:, None]
        y, physical = jnp.where(mask, y, 0.0), jnp.where(mask[..., None], physical, 0.0)
        learned = jax.jacrev(lambda w: predict(network.with_weights(w), physics, batch))(
            network.weights
        )
        root = jnp.sqrt(jnp.maximum(jnp.sum(valid), 1.0))
        jacobian = jnp.einsum("bym,bmw->byw", physical, learned).reshape(y.size, -1) / root
        step = half_inverse(jacobian, y.ravel() / root, tau)
        rate = eta / (1 + iteration / decay)
        flows = flows.at[batch].set(keep(valid, solved, physics.oseen.velocity[batch]))
        spent = Progress(jnp.sum(products), jnp.sum((y / root) ** 2) / 2, jnp.sum(~valid))
        network = network.with_weights(network.weights - rate * step)
        return network, (flows, iteration + 1), spent

    return Method(init, update, batch)


def half_inverse(
    jacobian: Float[Array, "rows weights"], y: Float[Array, " rows"], tau: float
) -> Float[Array, " weights"]:
    """V S^(-1/2) U^T y from the Gram matrix J J^T = U S^2 U^T, truncated at tau S_max."""
    squares, U = jnp.linalg.eigh(jacobian @ jacobian.T)
    S = jnp.sqrt(jnp.maximum(squares, 0.0))
    kept = tau * S[-1] < S
    power = jnp.where(kept, jnp.where(kept, S, 1.0) ** -1.5, 0.0)
    return jacobian.T @ (U @ (power * (U.T @ y)))
