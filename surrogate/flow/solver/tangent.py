"""The flow linearised at a state: the linear solves of the training methods, with their work.

Krylov vectors are of single precision, since a few digits are asked for.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from surrogate.arrays import full_single_precision, single
from surrogate.flow.grid.domain import Domain
from surrogate.flow.solver.adjoint import Effort, LinearSolveInfo, transposed_jacobian
from surrogate.flow.solver.krylov import gmres
from surrogate.flow.solver.steady import FlowState, Operators, flow_residual, wall_compliance


@full_single_precision
def slip_adjoint(
    domain: Domain,
    operators: Operators,
    state: FlowState,
    weights: Float[Array, " modes"],
    effort: Effort,
) -> tuple[Float[Array, " modes"], LinearSolveInfo]:
    """Return (dy/da)^T weights for the slip y of a forced flow, by one adjoint solve.

    Args:
      domain: the discrete problem.
      operators: of the body.
      state: the traction a and the flow that it drives.
      weights: one for each component of y.
      effort: of the linear solve, in single precision.
    """
    operators, state, weights = single((operators, state, weights))
    transposed, no_slip = transposed_jacobian(domain, operators, state), jnp.zeros_like(weights)

    def adjoint(z):
        return transposed(FlowState(z, no_slip))

    pulled = jax.vjp(operators.body.slip, state.velocity)[1](weights)[0]
    result = gmres(lambda z: adjoint(z).velocity, pulled, *effort)
    gradient = wall_compliance(operators).T @ weights - adjoint(result.x).amplitude
    return gradient.astype(float), LinearSolveInfo(result.steps + 1, result.converged)


@full_single_precision
def slip_jacobian(
    domain: Domain, operators: Operators, state: FlowState, effort: Effort
) -> tuple[Float[Array, "modes modes"], LinearSolveInfo]:
    """Return dy/da of the slip y of a forced flow, by one tangent solve per mode.

    Args:
      domain: the discrete problem.
      operators: of the body.
      state: the traction a and the flow that it drives.
      effort: of each linear solve, in single precision.
    """
    operators, state = single((operators, state))

    def respond(amplitude):
        return flow_residual(domain, operators, FlowState(state.velocity, amplitude))

    flow = _flow_jacobian(domain, operators, state)

    def column(mode):
        response = -jax.jvp(respond, (state.amplitude,), (mode,))[1]
        result = gmres(flow, response, *effort)
        return operators.body.slip(result.x), result.steps + 1, result.converged

    columns, steps, converged = jax.lax.map(
        column, jnp.eye(state.amplitude.size, dtype=state.amplitude.dtype)
    )
    matrix = (columns.T + wall_compliance(operators)).astype(float)
    return matrix, LinearSolveInfo(jnp.sum(steps), jnp.all(converged))


def _flow_jacobian(domain, operators, state):
    """Return the derivative of equation (2)'s residual in the velocity, as a linear function."""

    def forced_residual(velocity):
        return flow_residual(domain, operators, FlowState(velocity, state.amplitude))

    return jax.linearize(forced_residual, state.velocity)[1]
