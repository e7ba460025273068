"""Traction targets: what the inverted solver answers, kept from visit to visit.

``one_step_inversion`` is lagged physics: one coupled Newton step of body flow at every visit, started at the
network's prediction and the flow of the visit before. It linearises the physics there, ``slip =
C (a - a+)`` with a+ the step's traction and C the compliance dy/da; a sample whose drag no longer
moves is settled and costs nothing more. ``full_inversion`` solves the body flow at the first visit, and
a+ is its traction for good; a sample without one is left out.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.devices import compute_where
from surrogate.flow.loads import drag, drag_coefficient
from surrogate.flow.solver import steady
from surrogate.flow.solver.adjoint import BodyQuery, Effort, load_gradient
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.solver.tangent import coupled_step
from surrogate.model.network import DragNetwork
from surrogate.training.methods.method import Batch, evaluation_cost, predict
from surrogate.training.physics import Physics
from surrogate.training.samples import Samples

SLOPE = Effort(2e-4, 60)  # five times less leaves a mark on 256 bodies


class TrainingLabels(NamedTuple):
    """Per sample the target traction, its slopes, whether there is one, and if nothing is asked.

    ``slopes`` are d log Cd / d(parameters, log Re) of known and settled samples, where asked for.
    """

    tractions: Float[AnyArray, "samples modes"]
    slopes: Float[AnyArray, "samples inputs"]
    known: Bool[AnyArray, " samples"]
    settled: Bool[AnyArray, " samples"]

    def asks(self, batch: Batch) -> bool:
        """Whether one of these samples is not settled."""
        return not np.all(np.asarray(self.settled)[batch])


class Answer(NamedTuple):
    """One inversion: flow, traction, slope; whether they are good and final; applications of G."""

    state: FlowState
    slope: Float[Array, " inputs"] | None
    valid: Bool[Array, ""]
    final: Bool[Array, ""]
    products: Int[Array, ""]


Inversion = Callable[[Physics, Array, Array, Array, FlowState, Array], Answer]


def one_step_inversion(
    settle: float = 1e-4, effort: Effort = Effort(1e-2, 30), slopes: bool = False
) -> Inversion:
    """Invert by one coupled Newton step.

    ``settle`` is the relative change of drag below which a sample is final. With ``slopes`` a
    final sample also gets its shape gradient, by one adjoint solve.
    """

    def invert(physics, row, index, predicted, stored, known):
        operators = physics.operators_of(row)
        flow = jnp.where(known, stored.velocity, steady.oseen_velocity(operators, predicted))
        state, spent = coupled_step(physics.domain, operators, FlowState(flow, predicted), effort)
        traction = state.amplitude
        valid = spent.converged & (traction[0] < 0) & jnp.all(jnp.isfinite(traction))
        unmoved = jnp.abs(traction[0] / stored.amplitude[0] - 1) <= settle
        final = valid & known & unmoved
        answer = Answer(state, None, valid, final, spent.products + physics.renewal)
        return _with_slope(physics, operators, index, answer, slopes)

    return invert


def full_inversion(
    settings: NewtonSettings = NewtonSettings(1e-5, 15, 40), slopes: bool = False
) -> Inversion:
    """Invert by solving the body flow, once and for all.

    It fails where its slopes are wanted and not found; nothing else would come of a second try.
    """

    def invert(physics, row, index, predicted, stored, known):
        operators = physics.operators_of(row)
        state, info = steady.body_flow(physics.domain, operators, settings=settings)
        spent = info.products + physics.renewal
        answer = Answer(state, None, info.converged, info.converged, spent)
        answer = _with_slope(physics, operators, index, answer, slopes)
        return answer._replace(valid=answer.final, final=jnp.array(True))

    return invert


def _with_slope(physics, operators, index, answer, wanted):
    """The answer with the slope of log Cd where it is final and one is wanted."""
    parameters, reynolds = physics.samples.parameters[index], physics.samples.reynolds[index]

    def adjoint():
        domain, state = physics.domain, answer.state
        query = BodyQuery(physics.flow.markers, parameters, reynolds)
        in_shape, in_re, spent = load_gradient(drag, domain, operators, state, query, SLOPE)
        slope = jnp.append(in_shape, reynolds * in_re) / drag_coefficient(state.amplitude)
        good = spent.converged & jnp.all(jnp.isfinite(slope))
        return jnp.where(good, slope, 0.0), good, spent.products

    none = jnp.zeros(parameters.size + 1), answer.valid, jnp.zeros_like(answer.products)
    slope, good, spent = compute_where(answer.final & wanted, adjoint, none)
    return answer._replace(slope=slope, final=answer.final & good, products=answer.products + spent)


def no_labels(physics: Physics) -> TrainingLabels:
    """Nothing known: the tractions of Oseen flows."""
    none = jnp.zeros(physics.count, bool)
    count, parameters = physics.samples.parameters.shape
    return TrainingLabels(physics.tractions, jnp.zeros((count, parameters + 1)), none, none)


class _Told(NamedTuple):
    """What of an inversion everybody is told."""

    traction: Float[Array, " modes"]
    slope: Float[Array, " inputs"]
    valid: Bool[Array, ""]
    final: Bool[Array, ""]
    products: Int[Array, ""]


def evaluate_by_inversion(invert: Inversion) -> Callable:
    """The ``visit`` of a method that inverts the solver where samples are not settled."""

    def visit(network, physics, targets, flows, batch):
        def one(row, velocity, index, predicted, traction, slope, known, settled):
            stored = FlowState(velocity, traction)
            rest = Answer(stored, slope, known, *map(jnp.asarray, (True, 0)))

            def inverted():
                return invert(physics, row, index, predicted, stored, known)

            answer = compute_where(~settled, inverted, rest)
            new = jax.tree.map(lambda a, b: jnp.where(answer.valid, a, b), answer.state, stored)
            told = _Told(new.amplitude, answer.slope, answer.valid, answer.final, answer.products)
            return told, new.velocity

        predicted = predict(network, physics.samples, batch)
        seen = jax.tree.map(lambda leaf: leaf[batch], targets)
        told, flows, idle_work = physics.partition.evaluate(
            batch, flows, one, batch, predicted, *seen
        )
        known, settled = seen.known | told.valid, seen.settled | told.final
        new = TrainingLabels(told.traction, told.slope, known, settled)
        targets = jax.tree.map(lambda old, now: old.at[batch].set(now), targets, new)
        return targets, flows, evaluation_cost(told, physics, batch, idle_work)

    return visit


def drag_residuals(
    network: DragNetwork, samples: Samples, targets: TrainingLabels, index: Int[Array, ""]
) -> Float[Array, " outcomes"]:
    """Of one sample, log Cd and its slopes in scaled inputs, over what flow and adjoint told.

    Nought where they have told nothing yet.
    """
    parameters, reynolds = samples.parameters[index], samples.reynolds[index]
    z, steep = network.inputs(parameters, reynolds), network.inputs.steepness(parameters)
    log_drag, slopes = jax.value_and_grad(network.log_drag)(z)
    target = jnp.log(drag_coefficient(targets.tractions[index]))
    miss = jnp.where(targets.known[index], log_drag - target, 0.0)
    told = targets.known[index] & targets.settled[index]
    off = jnp.where(told, slopes - steep * targets.slopes[index], 0.0)
    return jnp.append(miss, off)


def oseen_influence_matrices(physics: Physics) -> Float[Array, "samples modes modes"]:
    """S G B of every sample: exact as Re -> 0, and free once the sample is prepared."""

    def one(kept):
        operators = physics.unpacked(kept)
        return steady.influence_matrix(physics.domain, operators)

    return physics.partition.gather(physics.partition.each(one, physics.operators))
