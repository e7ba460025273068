"""The operators of a stream that many bodies share, kept for the Reynolds numbers last asked for.

In 2-D they and their derivatives in Re take a good part of the time of a flow and its gradient
(study ``speed``), and designs and polars ask for many bodies at one Re. They depend on the domain
and on Re alone. In 3-D they take a smaller part, and too much memory to be kept.
"""

import functools

import jax.numpy as jnp
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.checks import transformed
from surrogate.flow import programs
from surrogate.flow.grid.domain import Domain
from surrogate.flow.solver.steady import StreamOperators

KEPT = 3  # domains and Re: enough for a flow and for the two flows that estimate its error


def kept_operators(
    domain: Domain, reynolds: Float[AnyArray, ""], *body: AnyArray
) -> StreamOperators:
    """Return the operators that do not depend on the body, those kept if there are.

    Args:
      domain: the discrete problem.
      reynolds: U D / nu.
      body: the arrays that give the body. Where JAX traces one of them, Re or a function around
        this call, the operators become part of what is traced, and none are kept.
    """
    if transformed(reynolds, *body):
        return programs.stream_operators(domain, reynolds)
    compute = _kept_operators if domain.lattice.dimension == 2 else _operators
    return compute(domain, float(reynolds))


def kept_derivatives(
    domain: Domain, reynolds: Float[AnyArray, ""], *body: AnyArray
) -> StreamOperators:
    """Return the derivatives in Re of the operators that do not depend on the body.

    The arguments are those of ``kept_operators``.
    """
    if transformed(reynolds, *body):
        return programs.stream_derivatives(domain, reynolds)
    compute = _kept_derivatives if domain.lattice.dimension == 2 else _derivatives
    return compute(domain, float(reynolds))


def forget_operators() -> None:
    """Drop the operators that are kept, so that the next flow takes its time as if alone."""
    _kept_operators.cache_clear()
    _kept_derivatives.cache_clear()


def _operators(domain, reynolds):
    return programs.stream_operators(domain, jnp.asarray(reynolds, float))


def _derivatives(domain, reynolds):
    return programs.stream_derivatives(domain, jnp.asarray(reynolds, float))


_kept_operators = functools.lru_cache(maxsize=KEPT)(_operators)
_kept_derivatives = functools.lru_cache(maxsize=1)(_derivatives)
