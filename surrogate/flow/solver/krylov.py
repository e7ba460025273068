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
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.arrays import by_lapack, full_single_precision, with_batching

ROWS = 7  # vectors that are projected out at once
# New vectors are projected again where the projection leaves less than this of their length, since
# what cancels are the digits by which they are orthogonal (Daniel et al. 1976); in a batch, of any
# system.
CANCELLED = 0.4


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
      b: the right-hand side, whose arrays are of one precision.
      tolerance: of the residual, relative to |b|.
      max_vectors: largest number of Krylov vectors; there is no restart.
    """
    leaves, structure = jax.tree.flatten(b)

    def shaped(vector):
        parts = (part.reshape(leaf.shape) for part, leaf in zip(vector, leaves, strict=True))
        return jax.tree.unflatten(structure, parts)

    def product(vector):
        return [leaf.reshape(-1) for leaf in jax.tree.leaves(matvec(shaped(vector)))]

    flat_b = [leaf.reshape(-1) for leaf in leaves]
    product = eqx.filter_closure_convert(product, flat_b)
    arrays, static = eqx.partition(product, eqx.is_array)
    arrays, closure = jax.tree.flatten(arrays)

    def multiply(arrays, v):
        return eqx.combine(jax.tree.unflatten(closure, arrays), static)(v)

    def solve(arrays, flat_b, tolerance):
        return _solve(lambda v: multiply(arrays, v), flat_b, tolerance, max_vectors)

    def solve_all(size, batched, arrays, flat_b, tolerance):
        products = jax.vmap(multiply, ([0 if one else None for one in batched[0]], 0))
        flat_b = [
            part if one else jnp.broadcast_to(part, (size, *part.shape))
            for part, one in zip(flat_b, batched[1], strict=True)
        ]
        return _solve(lambda v: products(arrays, v), flat_b, tolerance, max_vectors)

    tolerance = jnp.asarray(tolerance, flat_b[0].dtype)
    found = with_batching(solve, solve_all)(arrays, flat_b, tolerance)
    return found._replace(x=shaped(found.x))


@full_single_precision
def _solve(product, b, tolerance, m):
    """Solve systems of vectors in the last axis; the axes before it are those of a batch.

    A vector is a list of arrays, the leaves of a pytree. Orthogonalisation and the sum of the
    vectors touch only blocks of ``ROWS`` that have vectors; the small least-squares problem is kept
    triangular by Givens rotations, so its residual is known after every vector. Where a system has
    converged its part of that problem stays as it is.
    """
    batch, dtype, norm_b = b[0].shape[:-1], b[0].dtype, _norm(b)
    rows = -(-(m + 1) // ROWS) * ROWS

    def advance(state):
        k, steps, basis, triangle, rotations, rhs, error = state
        active = error > tolerance
        w = product([jax.lax.dynamic_index_in_dim(each, k, -2, False) for each in basis])
        w, column, height = _projected(w, basis, k // ROWS + 1, active)
        basis = _with_vector(basis, k + 1, w, height)
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

    nothing = [jnp.zeros((*batch, rows, part.shape[-1]), dtype) for part in b]
    start = (
        jnp.array(0),
        jnp.zeros(batch, int),
        _with_vector(nothing, 0, b, norm_b),
        jnp.broadcast_to(jnp.eye(m, dtype=dtype), (*batch, m, m)),
        jnp.zeros((*batch, m, 2), dtype).at[..., 0].set(1.0),
        jnp.zeros((*batch, m + 1), dtype).at[..., 0].set(1.0),
        (norm_b != 0).astype(dtype),
    )
    k, steps, basis, triangle, _, rhs, error = jax.lax.while_loop(unfinished, advance, start)
    known = jnp.where(jnp.arange(m) < steps[..., None], rhs[..., :m], 0.0)
    back_substitute = by_lapack(jax.scipy.linalg.solve_triangular)
    weights = (jax.vmap(back_substitute) if batch else back_substitute)(triangle, known)
    weights = norm_b[..., None] * jnp.pad(weights, [(0, 0)] * len(batch) + [(0, rows - m)])

    def add(block, x):
        vectors, own = _block(basis, weights, block)
        return [
            part + jnp.einsum("...k,...kn->...n", own, each)
            for part, each in zip(x, vectors, strict=True)
        ]

    blocks = (k + ROWS - 1) // ROWS
    x = jax.lax.fori_loop(0, blocks, add, [jnp.zeros_like(part) for part in b])
    return KrylovResult(x, steps, error, error <= tolerance)


def _projected(w, basis, blocks, active):
    """Return w without its part along the vectors, the lengths along them, and the length left.

    Classical Gram-Schmidt within a block of vectors, modified from block to block.
    """
    batch, rows = basis[0].shape[:-2], basis[0].shape[-2]

    def project(block, carry):
        w, column = carry
        vectors, lengths = _block(basis, column, block)
        overlap = sum(
            jnp.einsum("...kn,...n->...k", each, part)
            for each, part in zip(vectors, w, strict=True)
        )
        w = [
            part - jnp.einsum("...k,...kn->...n", overlap, each)
            for part, each in zip(w, vectors, strict=True)
        ]
        return w, jax.lax.dynamic_update_slice_in_dim(column, lengths + overlap, block * ROWS, -1)

    def cancelled(state):
        *_, left, passes = state
        enough = left >= CANCELLED * length  # not where NaN
        return (passes < 2) & jnp.any(active & ~enough)

    def once_more(state):
        w, column, _, passes = state
        w, column = jax.lax.fori_loop(0, blocks, project, (w, column))
        return w, column, _norm(w), passes + 1

    length = _norm(w)
    start = w, jnp.zeros((*batch, rows), w[0].dtype), jnp.zeros_like(length), 0
    return jax.lax.while_loop(cancelled, once_more, start)[:3]


def _block(basis, column, block):
    """Return a block of vectors, and the values of a column of numbers that belong to them."""
    start = block * ROWS
    vectors = [jax.lax.dynamic_slice_in_dim(each, start, ROWS, -2) for each in basis]
    return vectors, jax.lax.dynamic_slice_in_dim(column, start, ROWS, -1)


def _with_vector(basis, k, w, length):
    """Return the vectors with w / length as number k."""
    inverse = 1 / _or_one(length)[..., None]
    return [each.at[..., k, :].set(part * inverse) for each, part in zip(basis, w, strict=True)]


def _norm(w):
    # Not by dot products: batched programs add their terms one after the other, which costs a
    # length of 1e6 numbers four of its digits in single precision.
    return jnp.sqrt(sum(jnp.sum(part**2, axis=-1) for part in w))


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
