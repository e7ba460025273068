"""GMRES that stops as soon as its residual is small enough, for any pytree of arrays.

``jax.scipy.sparse.linalg.gmres`` finishes a whole restart cycle whatever the residual is; here
each vector costs a convolution with G, so the loop ends at the first vector that suffices.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.arrays import full_single_precision


class KrylovResult(NamedTuple):
    """The solution x of A x = b, and how GMRES ended.

    ``steps`` is the number of products with A, ``error`` the residual relative to |b|.
    """

    x: PyTree
    steps: Int[Array, ""]
    error: Float[Array, ""]
    converged: Bool[Array, ""]


@full_single_precision
def gmres(
    matvec: Callable[[PyTree], PyTree], b: PyTree, tolerance: float | Array, max_vectors: int
) -> KrylovResult:
    """Solve A x = b from x = 0 until |b - A x| <= tolerance |b| (Saad & Schultz 1986).

    Modified Gram-Schmidt and the sum of the vectors touch only those there are; the small
    least-squares problem is kept triangular by Givens rotations, so its residual is known after
    every vector.

    Args:
      matvec: returns A x, of the structure of b.
      b: the right-hand side.
      tolerance: of the residual, relative to |b|.
      max_vectors: largest number of Krylov vectors; there is no restart.
    """
    flat_b, unravel = ravel_pytree(b)
    norm_b = jnp.linalg.norm(flat_b)
    safe = jnp.where(norm_b > 0, norm_b, 1.0)
    m = max_vectors

    zeros = functools.partial(jnp.zeros, dtype=flat_b.dtype)

    def project(j, carry):
        w, column, basis = carry
        overlap = basis[j] @ w
        return w - overlap * basis[j], column.at[j].set(overlap), basis

    def advance(state):
        k, basis, triangle, rotations, rhs, _ = state
        w = ravel_pytree(matvec(unravel(basis[k])))[0]
        w, column = jax.lax.fori_loop(0, k + 1, project, (w, zeros(m + 1), basis))[:2]
        height = jnp.linalg.norm(w)
        basis = basis.at[k + 1].set(w / jnp.where(height > 0, height, 1.0))
        column = _rotate(column.at[k + 1].set(height), rotations, k)
        radius = jnp.hypot(column[k], column[k + 1])
        cosine, sine = jnp.array([column[k], column[k + 1]]) / jnp.where(radius > 0, radius, 1.0)
        rotations = rotations.at[k].set(jnp.array([cosine, sine]))
        triangle = triangle.at[:, k].set(column.at[k].set(radius).at[k + 1].set(0.0)[:m])
        rhs = rhs.at[k + 1].set(-sine * rhs[k]).at[k].set(cosine * rhs[k])
        return k + 1, basis, triangle, rotations, rhs, jnp.abs(rhs[k + 1])

    def unfinished(state):
        k, *_, error = state
        return (k < m) & (error > tolerance)

    start = (
        jnp.array(0),
        zeros((m + 1, flat_b.size)).at[0].set(flat_b / safe),
        jnp.eye(m, dtype=flat_b.dtype),
        zeros((m, 2)).at[:, 0].set(1.0),
        zeros(m + 1).at[0].set(1.0),
        (norm_b != 0).astype(flat_b.dtype),
    )
    k, basis, triangle, _, rhs, error = jax.lax.while_loop(unfinished, advance, start)
    weights = jax.scipy.linalg.solve_triangular(
        triangle, jnp.where(jnp.arange(m) < k, rhs[:m], 0.0)
    )
    x = jax.lax.fori_loop(0, k, lambda j, x: x + weights[j] * basis[j], zeros(flat_b.size))
    return KrylovResult(unravel(norm_b * x), k, error, error <= tolerance)


def _rotate(column, rotations, count):
    """Apply the first ``count`` Givens rotations to a new column of the Hessenberg matrix."""

    def step(j, column):
        cosine, sine = rotations[j]
        upper, lower = column[j], column[j + 1]
        return (
            column.at[j]
            .set(cosine * upper + sine * lower)
            .at[j + 1]
            .set(cosine * lower - sine * upper)
        )

    return jax.lax.fori_loop(0, count, step, column)
