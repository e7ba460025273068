"""The flow past one body of any kind, by continuation in Reynolds number where Newton needs it."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.shape import Shape
from surrogate.errors import NotConverged
from surrogate.flow import programs
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.solver.newton import NewtonInfo, NewtonSettings
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.streams import kept_operators

MAX_HALVINGS = 3  # of the step in Re: continuation in 2, 4 or 8 steps


class FlowResult(NamedTuple):
    """A solved flow: its state, and how Newton's method ended."""

    state: FlowState
    info: NewtonInfo


def solve_markers(
    domain: Domain,
    settings: NewtonSettings,
    markers: Markers,
    reynolds: Float[AnyArray, ""],
    guess: FlowState | None = None,
) -> FlowResult:
    """Solve the flow past a body; ``info.converged`` says whether the numbers mean anything.

    Args:
      domain: the discrete problem.
      settings: tolerances of Newton's method.
      markers: of the body, ``domain.nodes`` of them.
      reynolds: U D / nu.
      guess: state to begin from; the Oseen flow by default.
    """
    stream = kept_operators(domain, reynolds, *jax.tree.leaves(markers))
    operators = programs.assemble(domain, markers, reynolds, stream)
    return FlowResult(*programs.solve(domain, operators, guess, settings))


def solve_by_continuation(
    domain: Domain, settings: NewtonSettings, shape: Shape, reynolds: float
) -> tuple[FlowResult, int]:
    """Solve the flow past a shape; where Newton's method fails, reach Re in 2, 4 or 8 equal steps.

    Args:
      domain: the discrete problem.
      settings: tolerances of Newton's method.
      shape: the body.
      reynolds: U D / nu.

    Returns:
      The flow, and the convolutions with G of all attempts, their assembly included.

    Raises:
      NotConverged: the smallest steps failed too.
    """
    markers, spent = shape.markers(domain.nodes), 0
    for halvings in range(MAX_HALVINGS + 1):
        guess, steps = None, 2**halvings
        for k in range(1, steps + 1):
            found = solve_markers(
                domain, settings, markers, jnp.asarray(reynolds * k / steps, float), guess
            )
            spent += int(found.info.convolutions) + domain.assembly_cost
            if not bool(found.info.converged):
                break
            guess = found.state
        else:
            return found, spent
    raise NotConverged(not_converged_message(reynolds, found.info))


def not_converged_message(reynolds: float, info: NewtonInfo) -> str:
    """Return the message of a flow that did not converge."""
    return (
        f"body flow at Re {reynolds:g} did not converge: residual {float(info.residual):.1e} after "
        f"{int(info.steps)} Newton steps; more cells or a lower Re would help"
    )
