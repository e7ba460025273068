"""GMRES that stops as soon as its residual is small enough, for any pytree of arrays.

``jax.scipy.sparse.linalg.gmres`` finishes a whole restart cycle whatever the residual is; here
each vector costs a convolution with G, so the loop ends at the first vector that suffices. Under
``vmap`` it ends once every system of the batch has converged. It has a batching rule of its own:
that of ``while_loop`` would copy all Krylov vectors of the batch for every new one.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.arrays import by_lapack, full_single_precision, with_batching


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

    Args:
      matvec: returns A x, of the structure of b.
      b: the right-hand side.
      tolerance: of the residual, relative to |b|.
      max_vectors: largest number of Krylov vectors; there is no restart.
    """
    flat_b, unravel = ravel_pytree(b)
    product = eqx.filter_closure_convert(lambda v: ravel_pytree(matvec(unravel(v)))[0], flat_b)
    arrays, static = eqx.partition(product, eqx.is_array)
    arrays, structure = jax.tree.flatten(arrays)

    def multiply(arrays, v):
        return eqx.combine(jax.tree.unflatten(structure, arrays), static)(v)

    def solve(arrays, flat_b, tolerance):
        return _solve(lambda v: multiply(arrays, v), flat_b, tolerance, max_vectors)

    def solve_all(size, batched, arrays, flat_b, tolerance):
        products = jax.vmap(multiply, ([0 if one else None for one in batched[0]], 0))
        flat_b = flat_b if batched[1] else jnp.broadcast_to(flat_b, (size, *flat_b.shape))
        return _solve(lambda v: products(arrays, v), flat_b, tolerance, max_vectors)

    tolerance = jnp.asarray(tolerance, flat_b.dtype)
    found = with_batching(solve, solve_all)(arrays, flat_b, tolerance)
    return found._replace(x=unravel(found.x))


@full_single_precision
def _solve(product, b, tolerance, m):
    """Solve systems of vectors in the last axis; the axes before it are those of a batch.

    Modified Gram-Schmidt and the sum of the vectors touch only those there are; the small
    least-squares problem is kept triangular by Givens rotations, so its residual is known after
    every vector. Where a system has converged its part of that problem stays as it is.
    """
    batch, norm_b = b.shape[:-1], jnp.linalg.norm(b, axis=-1)

    def advance(state):
        k, steps, basis, triangle, rotations, rhs, error = state
        active = error > tolerance
        w, column = product(basis[k]), jnp.zeros((*batch, m + 1), b.dtype)
        w, column = jax.lax.fori_loop(0, k + 1, _project, (w, column, basis))[:2]
        height = jnp.linalg.norm(w, axis=-1)
        basis = basis.at[k + 1].set(w / _or_one(height)[..., None])
        column = _rotate(column.at[..., k + 1].set(height), rotations, k)
        radius = jnp.hypot(column[..., k], column[..., k + 1])
        cosine, sine = (column[..., i] / _or_one(radius) for i in (k, k + 1))
        rotations = rotations.at[..., k, :].set(jnp.stack([cosine, sine], -1))
        column = column.at[..., k].set(radius).at[..., k + 1].set(0.0)[..., :m]
        kept = active[..., None]
        triangle = triangle.at[..., k].set(jnp.where(kept, column, triangle[..., k]))
        last = rhs[..., k]
        turned = rhs.at[..., k + 1].set(-sine * last).at[..., k].set(cosine * last)
        error = jnp.where(active, jnp.abs(turned[..., k + 1]), error)
        rhs = jnp.where(kept, turned, rhs)
        return k + 1, steps + active, basis, triangle, rotations, rhs, error

    def unfinished(state):
        k, *_, error = state
        return (k < m) & jnp.any(error > tolerance)

    start = (
        jnp.array(0),
        jnp.zeros(batch, int),
        jnp.zeros((m + 1, *b.shape), b.dtype).at[0].set(b / _or_one(norm_b)[..., None]),
        jnp.broadcast_to(jnp.eye(m, dtype=b.dtype), (*batch, m, m)),
        jnp.zeros((*batch, m, 2), b.dtype).at[..., 0].set(1.0),
        jnp.zeros((*batch, m + 1), b.dtype).at[..., 0].set(1.0),
        (norm_b != 0).astype(b.dtype),
    )
    k, steps, basis, triangle, _, rhs, error = jax.lax.while_loop(unfinished, advance, start)
    known = jnp.where(jnp.arange(m) < steps[..., None], rhs[..., :m], 0.0)
    back_substitute = by_lapack(jax.scipy.linalg.solve_triangular)
    weights = (jax.vmap(back_substitute) if batch else back_substitute)(triangle, known)

    def add(j, x):
        return x + weights[..., j, None] * basis[j]

    x = norm_b[..., None] * jax.lax.fori_loop(0, k, add, jnp.zeros_like(b))
    return KrylovResult(x, steps, error, error <= tolerance)


def _project(j, carry):
    """Remove the part along vector j from w, and put its length into the column."""
    w, column, basis = carry
    overlap = jnp.einsum("...n,...n->...", basis[j], w)
    return w - overlap[..., None] * basis[j], column.at[..., j].set(overlap), basis


def _or_one(length):
    return jnp.where(length > 0, length, 1.0)


def _rotate(column, rotations, count):
    """Apply the first ``count`` Givens rotations to a new column of the Hessenberg matrix."""

    def step(j, column):
        cosine, sine = rotations[..., j, 0], rotations[..., j, 1]
        upper, lower = column[..., j], column[..., j + 1]
        upper, lower = cosine * upper + sine * lower, cosine * lower - sine * upper
        return column.at[..., j].set(upper).at[..., j + 1].set(lower)

    return jax.lax.fori_loop(0, count, step, column)
