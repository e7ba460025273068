"""The compiled programs of one flow, which drags, gradients, designs and solutions share.

They depend on the discrete problem, not on the class of bodies: whatever is asked of bodies on one
domain, its operators, its Newton solver and its adjoint are compiled once.
"""

from typing import Any

from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.compilation import CompilerOptions, compiled, quick_options
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.loads import Load
from surrogate.flow.solver import adjoint, steady
from surrogate.flow.solver.adjoint import Effort, LoadGradients
from surrogate.flow.solver.newton import NewtonInfo, NewtonSettings
from surrogate.flow.solver.steady import FlowState, Operators, StreamOperators


def _options(*arguments: Any) -> CompilerOptions:
    """Return the options of compilation for the dimension of the domain among the arguments."""
    (domain,) = (argument for argument in arguments if isinstance(argument, Domain))
    return quick_options(domain.lattice.dimension)


stream_operators = compiled("domain", options=_options)(steady.stream_operators)
stream_derivatives = compiled("domain", options=_options)(steady.stream_derivatives)
by_stream = compiled("domain", "efforts", options=_options)(adjoint.by_stream)


@compiled("domain", options=_options)
def assemble(
    domain: Domain, markers: Markers, reynolds: Float[AnyArray, ""], stream: StreamOperators
) -> Operators:
    """Assemble the operators of a body given by its markers, see ``steady.assemble``."""
    return steady.assemble(domain, markers, reynolds, stream)


@compiled("domain", "settings", options=_options)
def solve(
    domain: Domain,
    settings: NewtonSettings,
    operators: Operators,
    guess: FlowState | None,
) -> tuple[FlowState, NewtonInfo]:
    """Solve the flow past a body, from a guess or from its Oseen flow.

    Args:
      domain: the discrete problem.
      settings: tolerances of Newton's method.
      operators: of the body.
      guess: state to begin from; None for the Oseen flow.

    Returns:
      The state, and how Newton's method ended.
    """
    return steady.body_flow(domain, operators, guess, settings)


@compiled("loads", "domain", "efforts", options=_options)
def load_gradients(
    loads: tuple[Load, ...],
    domain: Domain,
    efforts: tuple[Effort, ...],
    operators: Operators,
    state: FlowState,
    reynolds: Float[Array, ""],
) -> LoadGradients:
    """Return the gradients of loads in the body's markers and in Re, by one adjoint for each load.

    The arguments are those of ``adjoint.load_gradients``.
    """
    return adjoint.load_gradients(loads, domain, operators, state, reynolds, efforts)
