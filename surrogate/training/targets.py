"""Traction targets: what the inverted solver answers, kept from visit to visit.

How much of the non-linear flow a training step sees is its fidelity:

- ``exact``: the flow that the network's traction drives, solved at every visit;
- ``lagged``: one coupled Newton step of body flow at every visit, started at the network's
  prediction and the flow of the visit before: the physics linearised there, ``slip = C (a - a+)``
  with a+ the step's traction and C the compliance dy/da. A sample whose drag no longer moves is
  settled and costs nothing more;
- ``frozen``: the body flow is solved at the first visit, and a+ is its traction for good.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from surrogate.flow import steady
from surrogate.flow.forces import drag_coefficient
from surrogate.flow.newton import NewtonSettings
from surrogate.flow.steady import FlowState
from surrogate.flow.tangent import Cost, Effort, coupled_step, drag_slope
from surrogate.training.method import Batch, keep, per_sample
from surrogate.training.physics import Physics

Fidelity = Literal["exact", "lagged", "frozen"]


class Targets(NamedTuple):
    """Per sample the last flow, the target traction, whether there is one, whether it is final.

    ``slopes`` are d log Cd / d(parameters) of final samples, where they were asked for.
    """

    flows: Float[Array, "samples 2 nx ny"]
    tractions: Float[Array, "samples modes"]
    slopes: Float[Array, "samples parameters"]
    known: Bool[Array, " samples"]
    settled: Bool[Array, " samples"]


class Answer(NamedTuple):
    """One inversion: flow, traction, slope; whether they are good and final; applications of G."""

    state: FlowState
    slope: Float[Array, " parameters"]
    valid: Bool[Array, ""]
    final: Bool[Array, ""]
    products: Int[Array, ""]


Inversion = Callable[[Physics, Array, Array, FlowState, Array], Answer]


def inversion(
    fidelity: Literal["lagged", "frozen"],
    settle: float = 1e-4,
    effort: Effort = Effort(1e-2, 30),
    settings: NewtonSettings = NewtonSettings(1e-5, 15, 40),
    slopes: bool = False,
) -> Inversion:
    """The inverse solver of a fidelity: ``(physics, index, prediction, stored, known) -> Answer``.

    ``settle`` is the relative change of drag below which a lagged sample is final. With ``slopes``
    a final sample also gets its shape gradient, by one adjoint solve.
    """

    def with_slope(physics, index, state, valid, final, products):
        parameters = physics.samples.parameters[index]

        def adjoint():
            slope, spent = log_drag_slope(physics, index, state, Effort(1e-3, 40))
            good = spent.converged & jnp.all(jnp.isfinite(slope))
            return jnp.where(good, slope, 0.0), good, spent.products

        def none():
            return jnp.zeros_like(parameters), valid, jnp.zeros_like(products)

        slope, good, spent = jax.lax.cond(final & slopes, adjoint, none)
        return Answer(state, slope, valid, final & good, products + spent)

    def step(physics, index, predicted, stored, known):
        case = physics.case(index)
        flow = jnp.where(known, stored.velocity, jnp.tensordot(predicted, case.response, axes=1))
        state, spent = coupled_step(physics.domain, case, FlowState(flow, predicted), effort)
        traction = state.amplitude
        valid = spent.converged & (traction[0] < 0) & jnp.all(jnp.isfinite(traction))
        unmoved = jnp.abs(traction[0] / stored.amplitude[0] - 1) <= settle
        final = valid & known & unmoved
        return with_slope(physics, index, state, valid, final, spent.products)

    def solve(physics, index, predicted, stored, known):
        state, info = steady.body_flow(physics.domain, physics.case(index), settings=settings)
        converged = info.converged
        return with_slope(physics, index, state, converged, converged, info.products)

    match fidelity:
        case "lagged":
            return step
        case "frozen":
            return solve


def no_targets(physics: Physics) -> Targets:
    """Nothing known: Oseen flows and tractions."""
    none = jnp.zeros(physics.count, bool)
    slopes = jnp.zeros_like(physics.samples.parameters)
    return Targets(physics.oseen.velocity, physics.oseen.amplitude, slopes, none, none)


def log_drag_slope(
    physics: Physics, index: Array, state: FlowState, effort: Effort
) -> tuple[Float[Array, " parameters"], Cost]:
    """d log Cd / d(parameters) of a sample whose body flow is ``state``."""
    parameters = physics.samples.parameters[index]
    slope, cost = drag_slope(physics.domain, physics.case(index), state, parameters, effort)
    return slope / drag_coefficient(state.amplitude), cost


def improve(
    physics: Physics,
    batch: Batch,
    predicted: Float[Array, "batch modes"],
    targets: Targets,
    invert: Inversion,
) -> tuple[Targets, Bool[Array, " batch"], Int[Array, ""]]:
    """Invert the solver for the samples of a batch that are not settled.

    Returns the targets, which inversions were good, and the applications of G spent.
    """
    flows, tractions, slopes, known, settled = jax.tree.map(lambda leaf: leaf[batch], targets)

    def visit(index, predicted, flow, traction, slope, known, settled):
        stored = FlowState(flow, traction)
        rest = Answer(stored, slope, *map(jnp.asarray, (True, True, 0)))
        return jax.lax.cond(
            settled, lambda: rest, lambda: invert(physics, index, predicted, stored, known)
        )

    answer = per_sample(visit, batch, predicted, flows, tractions, slopes, known, settled)
    state = keep(answer.valid, answer.state, FlowState(flows, tractions))
    new = (*state, answer.slope, known | answer.valid, settled | answer.final)
    targets = Targets(*(a.at[batch].set(b) for a, b in zip(targets, new, strict=True)))
    return targets, answer.valid, jnp.sum(answer.products)
