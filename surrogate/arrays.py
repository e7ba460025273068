"""Types of arguments (arrays, numbers, bodies), and operations that several packages need."""

from collections.abc import Callable, Mapping, Sequence
from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap
from jaxtyping import Array, ArrayLike, Bool, Float, Int, PyTree

AnyArray = jax.Array | np.ndarray
Number = float | np.number | AnyArray  # one number; an array of shape () as well
# Parameters of one body of a family, shape (parameters,), or a table of them by name.
Body = Sequence[float] | AnyArray | Mapping[str, Number]
Numbers = Number | Sequence[float]  # one number, or an array of them
# One body; or many, in the leading axes, shape (..., parameters), or as a table of arrays.
Bodies = Body | Sequence[Body] | Mapping[str, Numbers]


def picked(values: ArrayLike, index: int | Int[np.ndarray, " picked"]) -> jax.Array:
    """Return the values at an index of the last axis; for those of NumPy nothing is compiled."""
    values = values if isinstance(values, np.ndarray) else jnp.asarray(values)
    return jnp.asarray(values[..., index])


def array_module(*values: object) -> ModuleType:
    """Return ``jax.numpy`` if one of the values is an array of JAX or traced, else NumPy."""
    return jnp if any(isinstance(value, jax.Array) for value in values) else np


def padded(bodies: Float[np.ndarray, "bodies _"]) -> Float[np.ndarray, "padded _"]:
    """Return the bodies padded to a power of two by repeating the first ones.

    So few programs are compiled. Of no bodies it is one row of ones.
    """
    size = 2 ** (max(len(bodies), 1) - 1).bit_length()
    return bodies[np.arange(size) % len(bodies)] if len(bodies) else np.ones((1, bodies.shape[1]))


def weighted_sum(
    weights: Float[AnyArray, " fields"], fields: Float[AnyArray, "fields ..."]
) -> Float[Array, "..."]:
    """Return the sum of fields, each times its weight.

    It is a product with a matrix of flat fields: on a CPU the transpose of ``tensordot`` takes four
    times as long, and in programs of batches ``tensordot`` itself takes longer.
    """
    return (weights @ fields.reshape(len(fields), -1)).reshape(fields.shape[1:])


def compute_where(wanted: Bool[AnyArray, ""], compute: Callable, otherwise: PyTree) -> PyTree:
    """Return ``compute()`` where ``wanted``, else ``otherwise``.

    It is not computed if no body of the batch wants it: a loop of one iteration or none, since
    under ``vmap`` ``lax.cond`` would compute both branches.
    """

    def step(_):
        return jnp.zeros_like(wanted), compute()

    return jax.lax.while_loop(lambda carry: carry[0], step, (wanted, otherwise))[1]


def with_batching(one: Callable, many: Callable) -> Callable:
    """Return a function of arrays that ``vmap`` evaluates in a way of its own.

    Reverse mode does not pass through it.

    Args:
      one: the function.
      many: of the size of a batch, of which arguments have a batch axis (in front), and of the
        arguments; returns the results of ``one`` for the batch.
    """
    function = custom_vmap(one)

    @function.def_vmap
    def rule(size, batched, *arguments):
        some = any(jax.tree.leaves(batched))  # where it differentiates JAX asks for none too
        results = many(size, batched, *arguments) if some else one(*arguments)
        return results, jax.tree.map(lambda _: some, results)

    return function


def by_lapack(function: Callable) -> Callable:
    """Decorate a function of matrices that LAPACK computes on a CPU, so that batches do not hang.

    jaxlib divides a batch of matrices among the threads that run the program, and waits for them:
    two such calls at the same time wait for each other for ever. So on a CPU ``vmap`` of this takes
    one matrix after the other. Reverse mode does not pass through it.
    """

    def many(size, batched, *matrices):
        matrices = tuple(
            each if mapped else jnp.broadcast_to(each, (size, *each.shape))
            for each, mapped in zip(matrices, batched, strict=True)
        )
        if jax.default_backend() == "cpu":
            return jax.lax.map(lambda each: one(*each), matrices)
        return jax.vmap(function)(*matrices)

    one = with_batching(lambda *matrices: function(*matrices), many)
    return one


def full_single_precision(function: Callable) -> Callable:
    """Decorate a function so that its matrix products in single precision keep all 24 bits.

    By default GPUs round their factors to 11 bits (TF32) and TPUs to 8, with which GMRES does
    not converge to its tolerance. A returned function, called later, is not decorated.
    """
    return jax.default_matmul_precision("float32")(function)


def single(tree: PyTree) -> PyTree:
    """Return a pytree with every array cast to single precision."""

    def cast(leaf):
        return leaf.astype(jnp.complex64 if jnp.iscomplexobj(leaf) else jnp.float32)

    return jax.tree.map(cast, tree)
