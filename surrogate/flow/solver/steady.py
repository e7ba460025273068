"""The two steady problems: forced flow (traction given) and body flow (no slip asked).

Both solve u' = G (B a + convect(w u')) + far(a), equation (1) of the model: G the Oseen Green's
function, B the spreading of traction modes a, w the window, far the momentum flux outside it.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.far import far_response, far_velocity
from surrogate.flow.grid.immersed import Markers, Spreading, spread_modes
from surrogate.flow.grid.kernel import AnyKernel, make_kernel
from surrogate.flow.solver.newton import (
    Identity,
    NewtonInfo,
    NewtonSettings,
    System,
    root,
    single,
)

DEFAULT = NewtonSettings()
PIN = 0.1  # velocity per unit of uniform pressure


class Operators(eqx.Module):
    """One body in one stream, ready to be solved.

    ``response`` holds G B (the Oseen velocity of every mode) in single precision: it only
    preconditions and starts, and its cost is one application of G per mode.
    """

    kernel: AnyKernel
    far: Float[AnyArray, "terms axes ..."]
    body: Spreading
    response: Float[AnyArray, "modes axes ..."]


class FlowState(NamedTuple):
    """Perturbation velocity on the window's faces and traction modes (force on the fluid)."""

    velocity: Float[AnyArray, "axes ..."]
    amplitude: Float[AnyArray, " modes"]


def prepare(domain: Domain, markers: Markers, reynolds: Float[AnyArray, ""]) -> Operators:
    """Build kernel, far field and body; costs one application of G per mode, and some coarse."""
    kernel, far = stream(domain, reynolds)
    body = spread_modes(domain.lattice, domain.modes, domain.box, markers, reynolds)
    respond, rough = single(jax.lax.stop_gradient((kernel, body)))
    amplitudes = jnp.eye(domain.modes.count, dtype=jnp.float32)
    if domain.lattice.dimension == 3:  # all modes at once would take too much memory
        response = jax.lax.map(lambda amplitude: respond(rough.spread(amplitude)), amplitudes)
    else:
        response = jax.vmap(respond)(jax.vmap(rough.spread)(amplitudes))
    return Operators(kernel, far, body, response)


def stream(
    domain: Domain, reynolds: Float[AnyArray, ""]
) -> tuple[AnyKernel, Float[AnyArray, "terms axes ..."]]:
    """What of a operators the body does not change: kernel and far field."""
    lift = not domain.modes.symmetric
    far = far_response(domain.lattice, domain.far, reynolds, domain.height, lift)
    return make_kernel(domain.lattice, reynolds, domain.height, domain.mirrored), far


def assembly_cost(domain: Domain) -> int:
    """Applications of G in ``prepare`` (the coarse ones of the far field counted as one each)."""
    return domain.modes.count + len(domain.far) * (2 if domain.modes.symmetric else 5)


def flow_residual(
    domain: Domain, operators: Operators, state: FlowState
) -> Float[AnyArray, "axes ..."]:
    """u' - G (B a + convect(w u')) - far(a)."""
    velocity, amplitude = state
    window = domain.lattice.cutoff().astype(velocity.dtype)
    source = operators.body.spread(amplitude) + domain.lattice.convect(window * velocity)
    far = far_velocity(operators.far, total_force(domain, amplitude))
    return velocity - operators.kernel(source) - far


def slip_residual(
    domain: Domain, operators: Operators, state: FlowState
) -> Float[AnyArray, " modes"]:
    """Mode-weighted velocity on the contour, plus the compliance that pins the silent mode."""
    velocity, amplitude = state
    slip = operators.body.slip(velocity) + operators.body.slip_of_stream()
    return slip + pinning(domain, operators) @ amplitude


def pinning(domain: Domain, operators: Operators) -> Float[AnyArray, "modes modes"]:
    """Compliance added to S G B: the slip law, slight for every mode, firm for uniform pressure.

    Without the last the silent mode, which moves nothing, would take any value.
    """
    silent = operators.body.silent
    slight = domain.slip_compliance * jnp.eye(silent.size, dtype=silent.dtype)
    return slight + PIN * jnp.outer(silent, silent) + operators.body.slip_law


def total_force(domain: Domain, amplitude: Float[AnyArray, " modes"]) -> Float[AnyArray, " 2"]:
    """Force of the body on the fluid: the zeroth modes."""
    lift = 0.0 if domain.modes.symmetric else amplitude[domain.modes.lift_index]
    return jnp.stack([amplitude[0], lift])


def oseen_flow(domain: Domain, operators: Operators) -> FlowState:
    """Body flow without convection of the perturbation: exact as Re -> 0, a start otherwise."""
    amplitude = eliminate(domain, operators).inverse @ -operators.body.slip_of_stream()
    return FlowState(carried(operators, amplitude), amplitude)


def carried(
    operators: Operators, amplitude: Float[AnyArray, " modes"]
) -> Float[AnyArray, "axes ..."]:
    """The velocity that a traction drives where the perturbation carries no momentum."""
    return jnp.tensordot(amplitude, operators.response, axes=1)


def body_flow(
    domain: Domain,
    operators: Operators,
    guess: FlowState | None = None,
    settings: NewtonSettings = DEFAULT,
) -> tuple[FlowState, NewtonInfo]:
    """Flow and traction of a body at rest in the stream (P^-1)."""

    def residual(operators, state):
        return FlowState(
            flow_residual(domain, operators, state), slip_residual(domain, operators, state)
        )

    return root(
        System(residual, operators, eliminate(domain, operators)),
        guess or oseen_flow(domain, operators),
        _norm(domain),
        settings,
    )


def forced_flow(
    domain: Domain,
    operators: Operators,
    amplitude: Float[AnyArray, " modes"],
    guess: Float[AnyArray, "axes ..."] | None = None,
    settings: NewtonSettings = DEFAULT,
) -> tuple[Float[AnyArray, "axes ..."], NewtonInfo]:
    """Flow driven by a given traction (P)."""

    def residual(data, velocity):
        return flow_residual(domain, data[0], FlowState(velocity, data[1]))

    if guess is None:
        guess = carried(operators, amplitude)
    size = math.sqrt(domain.lattice.cell_volume)
    system = System(residual, (operators, amplitude), Identity())
    return root(system, guess, lambda v: size * jnp.linalg.norm(v), settings)


class Elimination(eqx.Module):
    """Exact inverse of the linear (Oseen) part of the coupled system, by the response G B."""

    inverse: Float[AnyArray, "modes modes"]
    response: Float[AnyArray, "modes axes ..."]
    body: Spreading

    def __call__(self, y: FlowState) -> FlowState:
        amplitude = self.inverse @ (y.amplitude - self.body.slip(y.velocity))
        return FlowState(y.velocity + jnp.tensordot(amplitude, self.response, axes=1), amplitude)


def eliminate(domain: Domain, operators: Operators) -> Elimination:
    """The elimination of a operators, the inverse being that of S G B + pinning."""
    operators = jax.lax.stop_gradient(operators)
    compliance = jax.vmap(operators.body.slip)(operators.response).T + pinning(domain, operators)
    return Elimination(jnp.linalg.inv(compliance), operators.response, operators.body)


def _norm(domain):
    def norm(state):
        return jnp.sqrt(domain.lattice.cell_volume * jnp.sum(state.velocity**2)) + jnp.linalg.norm(
            state.amplitude
        )

    return norm
