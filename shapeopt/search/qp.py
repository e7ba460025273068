"""Small quadratic programs with relaxed constraints, by an interior-point method in pure JAX.

The primal-dual predictor-corrector method of Mehrotra (1992; Nocedal and Wright 2006, chapter 16)
with a fixed number of steps, so that many programs are solved at once under ``jax.vmap``.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

# Steps: eight solve programs of the usual size to the digits that SQP needs, and with a bound all
# along the body (81 constraints) twenty do.
STEPS, STEPS_OF_MANY, MANY = 8, 20, 20
TO_BOUNDARY = 0.995  # part of the step to the boundary that is taken, as usual (N&W, section 16.6)
CONVERGED = 1e-16  # mean of dual times slack below which rounding would spoil further steps
RELAXED = 1e-6  # curvature of the relaxation, which keeps the matrix positive definite


def solve_relaxed_qp(
    hessian: Float[Array, "n n"],
    gradient: Float[Array, " n"],
    values: Float[Array, " constraints"],
    jacobian: Float[Array, "constraints n"],
    low: Float[Array, " n"],
    high: Float[Array, " n"],
    penalty: float,
) -> tuple[Float[Array, " n"], Float[Array, " constraints"]]:
    """Minimise g d + d B d / 2 + penalty t over the step d and the relaxation t >= 0.

    Subject to c + J d + t >= 0 and low <= d <= high, with low <= 0 <= high: equation (3) of
    ``shapeopt/README.md``. It has a solution whatever the constraints are.

    Args:
      hessian: B, symmetric and positive definite.
      gradient: g.
      values: c, the constraint values at d = 0.
      jacobian: J, their derivatives.
      low: lower bounds of d, at most 0.
      high: upper bounds of d, at least 0.
      penalty: price of the relaxation, rho.

    Returns:
      d, within ``low`` and ``high``, and the multipliers of the constraints.
    """
    size, many = gradient.size, values.size
    hessian = jnp.eye(size + 1).at[:size, :size].set(hessian).at[-1, -1].set(RELAXED)
    gradient, eye = jnp.append(gradient, penalty), jnp.eye(size + 1)
    rows = jnp.concatenate([jnp.append(jacobian, jnp.ones((many, 1)), 1), eye, -eye[:-1]])
    offsets = jnp.concatenate([values, -low, jnp.zeros(1), high])

    def step(_, state):
        """Return the state after one step.

        Its aim is rows x + offsets = slack >= 0, dual >= 0 and dual slack -> 0.
        """
        x, slack, dual = state
        stationarity = hessian @ x + gradient - rows.T @ dual
        gap = rows @ x + offsets - slack
        weight = dual / slack
        inverse = _inverse(hessian + (rows.T * weight) @ rows)

        def newton(target):
            """Return the Newton step towards dual slack = target."""
            push = (target - dual * slack) / slack - weight * gap
            dx = inverse @ (rows.T @ push - stationarity)
            return dx, rows @ dx + gap, push - weight * (rows @ dx)

        _, ds, dm = newton(0.0)
        length = _step_length(slack, dual, ds, dm)
        mean = jnp.mean(dual * slack)
        centre = jnp.mean((slack + length * ds) * (dual + length * dm)) ** 3 / mean**2
        dx, ds, dm = newton(centre - ds * dm)
        length = TO_BOUNDARY * _step_length(slack, dual, ds, dm)
        length = jnp.where(mean > CONVERGED, length, 0.0)
        return x + length * dx, slack + length * ds, dual + length * dm

    slack = jnp.maximum(offsets, 1e-2)
    start = jnp.zeros(size + 1), slack, 0.1 / slack
    x, _, dual = jax.lax.fori_loop(0, STEPS if many < MANY else STEPS_OF_MANY, step, start)
    return jnp.clip(x[:-1], low, high), dual[:many]


def _step_length(slack, dual, ds, dm):
    """Return the longest step, at most 1, along which slack and dual stay positive."""
    values, changes = jnp.append(slack, dual), jnp.append(ds, dm)
    falls = changes < 0
    return jnp.min(jnp.where(falls, -values / jnp.where(falls, changes, -1.0), 1.0), initial=1.0)


def _inverse(matrix):
    """Invert a small positive definite matrix by Gauss-Jordan elimination.

    LAPACK's factorisations are called matrix by matrix under ``jax.vmap`` on a CPU.
    """
    size = matrix.shape[0]
    work = jnp.append(matrix, jnp.eye(size), axis=1)
    for k in range(size):
        row = work[k] / work[k, k]
        work = (work - jnp.outer(work[:, k], row)).at[k].set(row)
    return work[:, size:]
