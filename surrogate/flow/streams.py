"""The operators of a stream that many bodies share, kept for the Reynolds numbers asked last.

In 2-D they and their derivatives in Re take a good part of the time of a flow and its gradient
(study ``speed``), and designs and polars ask for many bodies at one Re.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.checks import traced
from surrogate.flow import programs
from surrogate.flow.grid.domain import Domain
from surrogate.flow.solver.steady import StreamOperators

KEPT = 3  # domains and Re: those of a flow and of the two of its estimated error


def stream_operators(
    domain: Domain, reynolds: Float[AnyArray, ""], *bodies: AnyArray
) -> StreamOperators:
    """Return the operators that do not depend on the body.

    Args:
      domain: the discrete problem.
      reynolds: U D / nu.
      bodies: what the flow depends on beside Re. Where JAX traces it or Re, nothing is kept.
    """
    if traced(reynolds, *bodies):
        return programs.stream_operators(domain, reynolds)
    return _operators(domain, float(reynolds))


def stream_derivatives(
    domain: Domain, reynolds: Float[AnyArray, ""], *bodies: AnyArray
) -> StreamOperators:
    """Return the derivatives in Re of the operators that do not depend on the body.

    The arguments are those of ``stream_operators``.
    """
    if traced(reynolds, *bodies):
        return programs.stream_derivatives(domain, reynolds)
    return _derivatives(domain, float(reynolds))


def forget_streams() -> None:
    """Drop the operators that are kept, so that the next flow takes its time as if alone."""
    _operators.cache_clear()
    _derivatives.cache_clear()


@functools.lru_cache(maxsize=KEPT)
def _operators(domain, reynolds):
    with jax.ensure_compile_time_eval():  # also where JAX traces a function around this one
        return programs.stream_operators(domain, jnp.asarray(reynolds, float))


@functools.lru_cache(maxsize=1)
def _derivatives(domain, reynolds):
    with jax.ensure_compile_time_eval():
        return programs.stream_derivatives(domain, jnp.asarray(reynolds, float))
