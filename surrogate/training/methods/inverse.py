"""V S^(-kappa) U^T y for J = U S V^T, truncated: from the dense Jacobian, or without it.

kappa 1/2 is the half inverse, 1 Gauss-Newton, -1 gradient descent. Both forms rest on
V S^(-kappa) U^T = J^T (J J^T)^(-(1 + kappa)/2), which needs no singular vectors of the weights.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

Linear = Callable[[Array], Array]


def partial_inverse(
    jacobian: Float[Array, "rows weights"],
    y: Float[Array, " rows"],
    tau: float,
    kappa: float = 0.5,
) -> Float[Array, " weights"]:
    """Dense, from the smaller Gram matrix; singular values up to tau S_max are dropped."""
    rows, weights = jacobian.shape
    if rows <= weights:
        squares, U = jnp.linalg.eigh(jacobian @ jacobian.T)
        return jacobian.T @ (U @ (_powers(squares, tau, kappa) * (U.T @ y)))
    columns = jax.lax.optimization_barrier(jacobian.T)  # transposed once, products take half
    squares, V = jnp.linalg.eigh(columns @ columns.T)
    return V @ (_powers(squares, tau, kappa) * (V.T @ (columns @ y)))


def partial_inverse_lanczos(
    forward: Linear,
    transpose: Linear,
    y: Float[Array, " rows"],
    tau: float,
    kappa: float = 0.5,
    vectors: int = 64,
) -> Float[Array, " weights"]:
    """Matrix-free: ``forward`` is v -> J v, ``transpose`` is z -> J^T z, one of each per vector.

    Lanczos on J J^T from y (Golub & Van Loan, 10.1), orthogonalised against all vectors twice;
    the Ritz values stand for the squared singular values, and are truncated alike. Memory is
    ``vectors`` by rows plus one product's, never rows by weights.
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
        exhausted = length <= 1e-13 * jnp.max(jnp.abs(matrix))
        return basis.at[k + 1].set(jnp.where(exhausted, 0.0, w), mode="drop"), matrix

    vectors = min(vectors, y.size)
    basis = jnp.zeros((vectors, y.size)).at[0].set(unit(y)[0])
    basis, matrix = jax.lax.fori_loop(0, vectors, step, (basis, jnp.zeros((vectors, vectors))))
    squares, W = jnp.linalg.eigh(jnp.triu(matrix) + jnp.triu(matrix, 1).T)
    return transpose((W @ (_powers(squares, tau, kappa) * W[0]) * size) @ basis)


def _powers(squares, tau, kappa):
    """S^-(1 + kappa) of ascending squares S^2, nought where S is truncated."""
    S = jnp.sqrt(jnp.maximum(squares, 0.0))
    kept = tau * S[-1] < S
    return jnp.where(kept, jnp.where(kept, S, 1.0) ** -(1 + kappa), 0.0)
