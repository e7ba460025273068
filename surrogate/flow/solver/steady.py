"""The two steady problems: body flow (no slip on the wall) and forced flow (traction given).

Both solve u' = G (B a + convect(w u')) + Phi(a), equation (2) of ``surrogate/flow/README.md``, for
the perturbation u' of the stream: G is the Oseen Green's function, B spreads the traction modes a,
w is the blending function of the domain, Phi the response to the momentum flux outside of it. Body
flow also asks for S (e_x + u') + C a = 0, equation (3).
"""

import functools
import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Float

from surrogate.arrays import AnyArray, by_lapack
from surrogate.flow.grid.domain import Domain, GreenFunction
from surrogate.flow.grid.far import far_powers, far_response, far_velocity
from surrogate.flow.grid.immersed import Markers, Spreading
from surrogate.flow.solver.newton import (
    Identity,
    NewtonInfo,
    NewtonSettings,
    System,
    root,
)
from surrogate.flow.solver.response import Response, mode_response

DEFAULT = NewtonSettings()
# Velocity per unit of uniform pressure, which drives no flow and has no net force on a closed
# surface, so that any positive value does: 0.01 and 1 change Cd and Cl by less than 1e-4 (study
# ``constants``).
NULL_MODE_COMPLIANCE = 0.1


class StreamOperators(NamedTuple):
    """The operators that depend on the domain and Re alone: ``green`` and ``far`` of Operators."""

    green: GreenFunction
    far: Float[AnyArray, "terms axes ..."]


class Operators(eqx.Module):
    """The discrete operators of one body at one Reynolds number.

    Attributes:
      green: the Green's function G.
      far: coefficients of Phi, the response to the momentum flux outside the domain; their order
        is that of ``far_powers``.
      body: the spreading operator B and its transpose S.
      response: G B, which preconditions and starts the solvers only.
      markers: the body's surface markers, on which loads are evaluated.
    """

    green: GreenFunction
    far: Float[AnyArray, "terms axes ..."]
    body: Spreading
    response: Response
    markers: Markers


class FlowState(NamedTuple):
    """The perturbation velocity u' on the domain's faces, and the traction modes a.

    The traction is the force on the fluid.
    """

    velocity: Float[AnyArray, "axes ..."]
    amplitude: Float[AnyArray, " modes"]


def assemble(
    domain: Domain,
    markers: Markers,
    reynolds: Float[AnyArray, ""],
    stream: StreamOperators | None = None,
) -> Operators:
    """Assemble the operators of a body.

    With those of the stream it takes ``domain.assembly_cost`` convolutions with G.

    Args:
      domain: the discrete problem.
      markers: of the body, ``domain.nodes`` of them, in D.
      reynolds: U D / nu.
      stream: the operators that do not depend on the body; computed if not given.
    """
    green, far = stream_operators(domain, reynolds) if stream is None else stream
    body = domain.spread_body(markers, reynolds)
    response = mode_response(domain, green, body, reynolds)
    return Operators(green, far, body, response, markers)


def stream_operators(domain: Domain, reynolds: Float[AnyArray, ""]) -> StreamOperators:
    """Return the operators that do not depend on the body."""
    far = far_response(domain, reynolds)
    return StreamOperators(domain.green_function(domain.lattice, reynolds), far)


def stream_derivatives(domain: Domain, reynolds: Float[AnyArray, ""]) -> StreamOperators:
    """Return the derivatives in Re of the operators that do not depend on the body."""
    operators = functools.partial(stream_operators, domain)
    return jax.jvp(operators, (reynolds,), (jnp.ones_like(reynolds),))[1]


def flow_residual(
    domain: Domain, operators: Operators, state: FlowState
) -> Float[AnyArray, "axes ..."]:
    """Return u' - G (B a + convect(w u')) - Phi(a), the residual of equation (2)."""
    response = operators.green(momentum_source(domain, operators, state))
    return without_far_field(domain, operators, state) - response


def momentum_source(
    domain: Domain, operators: Operators, state: FlowState
) -> Float[AnyArray, "axes ..."]:
    """Return B a + convect(w u'), the force density to which G responds in equation (2)."""
    blending = domain.lattice.cutoff().astype(state.velocity.dtype)
    return operators.body.spread(state.amplitude) + domain.lattice.convect(
        blending * state.velocity
    )


def without_far_field(
    domain: Domain, operators: Operators, state: FlowState
) -> Float[AnyArray, "axes ..."]:
    """Return u' - Phi(a), the terms of equation (2) that are not a response to a force density."""
    powers = far_powers(domain)
    return state.velocity - far_velocity(operators.far, domain.forces(state.amplitude), powers)


def slip_residual(operators: Operators, state: FlowState) -> Float[AnyArray, " modes"]:
    """Return S (e_x + u') + C a, the residual of equation (3)."""
    velocity, amplitude = state
    slip = operators.body.slip(velocity) + operators.body.slip_of_stream()
    return slip + wall_compliance(operators) @ amplitude


def residual(domain: Domain, operators: Operators, state: FlowState) -> FlowState:
    """Return the residuals of equations (2) and (3) of body flow."""
    return FlowState(flow_residual(domain, operators, state), slip_residual(operators, state))


def wall_compliance(operators: Operators) -> Float[AnyArray, "modes modes"]:
    """Return C, the compliance added to S G B.

    It is that of the wall, and a larger one of the constant-pressure null mode, which moves no
    fluid and would take any value without it.
    """
    null_mode = operators.body.null_mode
    return operators.body.compliance + NULL_MODE_COMPLIANCE * jnp.outer(null_mode, null_mode)


def influence_matrix(operators: Operators) -> Float[AnyArray, "modes modes"]:
    """Return S G B + C, the slip that each traction mode causes in the Oseen flow."""
    return operators.response.slips(operators.body) + wall_compliance(operators)


def body_flow(
    domain: Domain,
    operators: Operators,
    guess: FlowState | None = None,
    settings: NewtonSettings = DEFAULT,
) -> tuple[FlowState, NewtonInfo]:
    """Solve for flow and traction of a body at rest in the stream, from a guess or Oseen flow.

    Args:
      domain: the discrete problem.
      operators: of the body.
      guess: state to begin from; the Oseen flow by default.
      settings: tolerances of Newton's method.

    Returns:
      The state that solves equations (2) and (3), and how Newton's method ended.
    """
    elimination = eliminate(operators)
    return root(
        System(lambda data, state: residual(domain, data, state), operators, elimination),
        guess or elimination.oseen_flow(),
        lambda state: _size(domain, state.velocity) + jnp.linalg.norm(state.amplitude),
        settings,
    )


def forced_flow(
    domain: Domain,
    operators: Operators,
    amplitude: Float[AnyArray, " modes"],
    guess: Float[AnyArray, "axes ..."],
    settings: NewtonSettings,
) -> tuple[Float[AnyArray, "axes ..."], NewtonInfo]:
    """Solve for the flow that a given traction drives, whatever its slip on the wall.

    Args:
      domain: the discrete problem.
      operators: of the body.
      amplitude: of the traction modes a, force on the fluid.
      guess: velocity u' to begin from, such as G B a, ``operators.response(amplitude)``.
      settings: tolerances of Newton's method.

    Returns:
      The velocity u' on the faces that solves equation (2), and how Newton's method ended.
    """

    def forced_residual(data, velocity):
        return flow_residual(domain, data[0], FlowState(velocity, data[1]))

    system = System(forced_residual, (operators, amplitude), Identity())
    return root(system, guess, lambda velocity: _size(domain, velocity), settings)


def _size(domain, velocity):
    """Return the L2 norm of a velocity over the whole domain."""
    return math.sqrt(domain.lattice.cell_volume) * jnp.linalg.norm(velocity)


class Elimination(eqx.Module):
    """The inverse of the linear (Oseen) part of equations (2) and (3), to the digits of G B."""

    inverse: Float[AnyArray, "modes modes"]
    response: Response
    body: Spreading

    def __call__(self, y: FlowState) -> FlowState:
        amplitude = self.inverse @ (y.amplitude - self.body.slip(y.velocity))
        return FlowState(y.velocity + self.response(amplitude), amplitude)

    def oseen_flow(self) -> FlowState:
        """Return the Oseen flow, without convection u' grad u'; it is exact as Re tends to 0."""
        amplitude = self.inverse @ -self.body.slip_of_stream()
        return FlowState(self.response(amplitude), amplitude)


def eliminate(operators: Operators) -> Elimination:
    """Return the inverse of the linear part of a body's equations.

    Derivatives do not pass through it.
    """
    operators = jax.lax.stop_gradient(operators)
    inverse = by_lapack(jnp.linalg.inv)(influence_matrix(operators))
    return Elimination(inverse, operators.response, operators.body)
