"""The partial inverse V S^-kappa U^T y of a matrix J = U S V^T, and the step of weights by it.

kappa 1/2 is the half inverse, 1 Gauss-Newton, -1 gradient descent; small singular values are
dropped. It is computed dense, or without the matrix by Lanczos vectors, both by

    V S^-kappa U^T = J^T (J J^T)^(-(1 + kappa) / 2),

which needs no singular vectors V in the space of the weights.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from surrogate.training.methods.method import Batch

Weights = Float[Array, " weights"]
Residuals = Callable[[Weights, Int[Array, ""]], Float[Array, " outcomes"]]  # of one sample
LinearMap = Callable[[Array], Array]
OVERSHOOT = 1.5  # times Gauss-Newton's step, at most, where steps are limited
EXHAUSTED = 1e-13  # a Lanczos vector of this relative length is rounding error


def weight_step(
    residuals: Residuals,
    weights: Weights,
    batch: Batch,
    y: Float[Array, "batch outcomes"],
    tau: float,
    kappa: float,
    vectors: int | None = None,
    limited: bool = False,
) -> Weights:
    """Return V S^-kappa U^T y / sqrt(B), the step in the weights, dense or by Lanczos vectors.

    J = dy/d(weights) / sqrt(B) = U S V^T is the Jacobian of a batch, B the number of its samples
    whose y is not zero. The new weights are the old ones minus a learning rate times this step.

    Args:
      residuals: function of the weights and the index of one sample that returns its residuals;
        they need only have the right derivatives, the values are taken from ``y``.
      weights: at which J is evaluated.
      batch: indices of the samples.
      y: residuals of these samples; all zero for a sample that has none.
      tau: singular values up to ``tau`` times the largest are dropped.
      kappa: exponent of the inverse: 1/2 for HIG, 1 for Gauss-Newton, -1 for gradient descent.
      vectors: number of Lanczos vectors; None for the dense inverse.
      limited: no component exceeds 1.5 times Gauss-Newton's step, as in ``partial_inverse``.

    Returns:
      The step, of the shape of the weights.
    """
    root = jnp.sqrt(samples_with_residuals(y))
    y = y / root
    if vectors is None:
        rows = jax.vmap(jax.jacrev(residuals), (None, 0))(weights, batch) / root
        rows = rows.reshape(y.size, -1)
        return partial_inverse(rows, y.ravel(), tau, kappa, limited)

    forward = jax.linearize(lambda w: jax.vmap(residuals, (None, 0))(w, batch) / root, weights)[1]
    adjoint = jax.linear_transpose(forward, weights)
    return partial_inverse_lanczos(
        lambda v: forward(v).ravel(),
        lambda z: adjoint(z.reshape(y.shape))[0],
        y.ravel(),
        tau,
        kappa,
        vectors,
        limited,
    )


def samples_with_residuals(y: Float[Array, "batch outcomes"]) -> Int[Array, ""]:
    """Return the number of samples whose residuals are not all zero, at least 1."""
    return jnp.maximum(jnp.sum(jnp.any(y != 0, axis=1)), 1)


def partial_inverse(
    jacobian: Float[Array, "rows weights"],
    y: Float[Array, " rows"],
    tau: float,
    kappa: float = 0.5,
    limited: bool = False,
) -> Float[Array, " weights"]:
    """Return V S^-kappa U^T y of a dense matrix J = U S V^T, truncated.

    By the eigendecomposition of the smaller of J J^T and J^T J.

    Args:
      jacobian: J.
      y: right-hand side.
      tau: singular values up to ``tau`` times the largest are dropped.
      kappa: exponent of the inverse: 1/2 for HIG, 1 for Gauss-Newton, -1 for gradient descent.
      limited: no component exceeds 1.5 times Gauss-Newton's 1 / S, which reaches the minimum of
        the linearised problem: S^-kappa does for kappa = 1/2 where S > 2.25, and beyond S = 4
        residuals grow.

    Returns:
      The step in the weights; its sign is that of J^T y.
    """
    rows, weights = jacobian.shape
    if rows <= weights:
        squares, U = jnp.linalg.eigh(jacobian @ jacobian.T)
        return jacobian.T @ (U @ (_powers(squares, tau, kappa, limited) * (U.T @ y)))
    columns = jax.lax.optimization_barrier(jacobian.T)  # transposed once: half the time
    squares, V = jnp.linalg.eigh(columns @ columns.T)
    return V @ (_powers(squares, tau, kappa, limited) * (V.T @ (columns @ y)))


def partial_inverse_lanczos(
    forward: LinearMap,
    transpose: LinearMap,
    y: Float[Array, " rows"],
    tau: float,
    kappa: float = 0.5,
    vectors: int = 64,
    limited: bool = False,
) -> Float[Array, " weights"]:
    """Return V S^-kappa U^T y without forming J = U S V^T, by the Lanczos process on J J^T from y.

    Golub and Van Loan, section 10.1. Each vector is orthogonalised twice against all
    others. Ritz values stand for the squared singular values and are truncated alike. The memory
    is ``vectors`` times the rows.

    Args:
      forward: v -> J v.
      transpose: z -> J^T z.
      y: right-hand side.
      tau: singular values up to ``tau`` times the largest are dropped.
      kappa: exponent of the inverse: 1/2 for HIG, 1 for Gauss-Newton, -1 for gradient descent.
      vectors: number of Lanczos vectors, at most one a row; each takes one product with J and one
        with J^T.
      limited: no component exceeds 1.5 times Gauss-Newton's step, as in ``partial_inverse``.

    Returns:
      The step in the weights; with as many vectors as rows it is that of ``partial_inverse``.
    """
    size = jnp.linalg.norm(y)

    def unit(v):
        length = jnp.linalg.norm(v)
        return v / jnp.where(length > 0, length, 1.0), length

    def step(k, carry):
        basis, matrix = carry
        w = forward(transpose(basis[k]))
        overlap = basis @ w
        matrix = matrix.at[:, k].set(overlap)
        w = w - overlap @ basis
        w, length = unit(w - (basis @ w) @ basis)
        exhausted = length <= EXHAUSTED * jnp.max(jnp.abs(matrix))
        return basis.at[k + 1].set(jnp.where(exhausted, 0.0, w), mode="drop"), matrix

    vectors = min(vectors, y.size)
    basis = jnp.zeros((vectors, y.size)).at[0].set(unit(y)[0])
    basis, matrix = jax.lax.fori_loop(0, vectors, step, (basis, jnp.zeros((vectors, vectors))))
    squares, W = jnp.linalg.eigh(jnp.triu(matrix) + jnp.triu(matrix, 1).T)
    return transpose((W @ (_powers(squares, tau, kappa, limited) * W[0]) * size) @ basis)


def _powers(squares, tau, kappa, limited):
    """Return S^-(1 + kappa) of ascending S^2, if limited at most 1.5 S^-2; 0 where truncated."""
    S = jnp.sqrt(jnp.maximum(squares, 0.0))
    kept = tau * S[-1] < S
    S = jnp.where(kept, S, 1.0)
    powers = S ** -(1 + kappa)
    return jnp.where(kept, jnp.minimum(powers, OVERSHOOT * S**-2) if limited else powers, 0.0)
