"""Inversions of the flow solver: from a body and its no-slip condition to the label of a sample.

``FullSolve`` solves the body flow once. ``NewtonSteps`` makes at most two Newton steps at each
evaluation, so that the network learns from flows that have not converged yet.
"""

import abc
import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray, compute_where
from surrogate.devices import Sharded
from surrogate.flow.derivatives import quick_efforts
from surrogate.flow.loads import drag_coefficient
from surrogate.flow.solver import steady
from surrogate.flow.solver.adjoint import by_stream, load_gradients
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.steady import FlowState, stream_derivatives
from surrogate.model.network import LoadNetwork
from surrogate.model.outputs import gradients_of_outputs
from surrogate.training.methods.labels import TrainingLabels
from surrogate.training.methods.method import (
    Batch,
    EvaluationCost,
    Evaluator,
    evaluation_cost,
    predict,
    with_rows,
)
from surrogate.training.physics import Physics, Sample

LABEL_FLOW = NewtonSettings(1e-5, 15, 40)  # of a full solve
# of an evaluation by steps: a smaller forcing term, as one more evaluation assembles the operators
LABEL_STEPS = LABEL_FLOW._replace(max_steps=2, forcing=0.1)


class InversionResult(NamedTuple):
    """The result of one inversion: flow, slopes, whether valid and converged, convolutions."""

    state: FlowState
    slopes: Float[Array, "loads inputs"]
    valid: Bool[Array, ""]
    converged: Bool[Array, ""]
    convolutions: Int[Array, ""]


class LabelResult(NamedTuple):
    """The label of an evaluated sample, whether the evaluation succeeded, and its convolutions."""

    label: TrainingLabels
    valid: Bool[AnyArray, "*samples"]
    convolutions: Int[AnyArray, "*samples"]


class Inversion(Evaluator):
    """A way to invert the flow solver: from a body and its no-slip condition to the traction.

    Attributes:
      slopes: whether a converged label gets its slopes, by an adjoint solve a load.
      newton: tolerance of the label, and the limits of an evaluation.
    """

    slopes: bool
    newton: NewtonSettings

    @abc.abstractmethod
    def invert(
        self, sample: Sample, predicted: Float[Array, " modes"], stored: FlowState, valid: Array
    ) -> InversionResult:
        """Invert the flow solver for one sample.

        Args:
          sample: body and Reynolds number.
          predicted: the network's traction modes.
          stored: traction of the last valid evaluation, of the Oseen flow before there is one;
            its velocity too with ``warm_starts``, zero before.
          valid: whether there was one.

        Returns:
          The flow, its velocity of the shape of the stored one; slopes; whether the label is valid
          and whether it has converged; the convolutions, without those of ``Sample.renewal``.
        """

    def evaluate(
        self,
        network: LoadNetwork,
        physics: Physics,
        labels: TrainingLabels,
        velocities: Sharded,
        batch: Batch,
    ) -> tuple[TrainingLabels, Sharded, EvaluationCost]:
        """Invert the solver for each sample of a chunk whose label has not converged.

        A label is replaced where the inversion is valid, and withdrawn where it ends without one.

        Args:
          network: predicts the tractions from which inversions may start.
          physics: the flow solver of the samples.
          labels: all labels so far.
          velocities: this device's rows of the chunk.
          batch: indices of the chunk's samples.

        Returns:
          The new labels, the new velocities and the cost.
        """

        def evaluate_sample(sample, velocity, predicted, label):
            stored = FlowState(velocity, label.tractions)

            def inverted():
                result = self.invert(sample, predicted, stored, label.valid)
                return result._replace(convolutions=result.convolutions + sample.renewal)

            kept = InversionResult(stored, label.slopes, label.valid, jnp.array(True), jnp.array(0))
            result = compute_where(~label.converged, inverted, kept)
            new = jax.tree.map(lambda a, b: jnp.where(result.valid, a, b), result.state, stored)
            kept_or_new = result.valid | (label.valid & ~result.converged)
            flags = kept_or_new, label.converged | result.converged
            outputs = sample.outputs(new.amplitude)
            succeeded = result.valid | label.converged  # earlier failures are not counted again
            label = TrainingLabels(new.amplitude, outputs, result.slopes, *flags)
            return LabelResult(label, succeeded, result.convolutions), new.velocity

        predicted = predict(network, physics.samples, batch)
        old = jax.tree.map(lambda leaf: leaf[batch], labels)
        found = physics.evaluate(batch, velocities, evaluate_sample, predicted, old)
        labels = with_rows(labels, batch, found.results.label)
        return labels, found.states, evaluation_cost(found, physics, batch)

    def _solved(self, sample, operators, start=None):
        """Return (flow, how Newton's method ended, slopes, whether sound, convolutions).

        A flow is sound whose drag is positive and whose slopes, if it has converged, are found.
        """
        state, info = steady.body_flow(sample.domain, operators, start, self.newton)
        slopes, good, convolutions = self._slopes_where(info.converged, sample, operators, state)
        sound = good & (drag_coefficient(state.amplitude) > 0)
        return state, info, slopes, sound, info.convolutions + convolutions

    def _slopes_where(self, converged, sample, operators, state):
        """Return (d outputs / d(parameters, log Re), whether sound, convolutions) by the adjoints.

        Zeros, which are sound, where the flow has not converged, or where ``slopes`` is false.
        """
        loads = sample.flow.bodies.loads
        zeros = jnp.zeros((len(loads), sample.parameters.size + 1))
        none = zeros, jnp.array(True), jnp.array(0)
        if not self.slopes:
            return none

        def adjoint():
            reynolds, efforts = sample.reynolds, quick_efforts(loads)
            found = load_gradients(loads, sample.domain, operators, state, reynolds, efforts)
            derivatives = stream_derivatives(sample.domain, reynolds)
            by_re = found.by_reynolds + by_stream(
                sample.domain, operators, state, derivatives, found.adjoints, efforts
            )
            by_shape = sample.flow.bodies.in_parameters(sample.parameters, found.by_markers)
            slopes = jnp.column_stack([by_shape, reynolds * by_re])
            slopes = gradients_of_outputs(sample.loads(state.amplitude), slopes)
            sound = found.work.converged & jnp.all(jnp.isfinite(slopes))
            return jnp.where(sound, slopes, 0.0), sound, found.work.convolutions

        return compute_where(converged, adjoint, none)


@dataclasses.dataclass(frozen=True)
class NewtonSteps(Inversion):
    """At most two steps of Newton's method at each evaluation, from the flow of the last one.

    The first evaluation starts from the Oseen flow. A sample whose evaluation fails counts as
    converged without a valid label: a second attempt would be the same computation. It fails where
    a step does not lessen the residual, where Cd is not positive, or where slopes are not found.

    Attributes:
      from_prediction: whether the traction starts from the network's instead, the velocity at first
        from the one that this traction drives by the Oseen equations; an evaluation that fails is
        then made again, from another prediction.
    """

    slopes: bool = False
    from_prediction: bool = False
    newton: NewtonSettings = LABEL_STEPS
    warm_starts = True

    def invert(
        self, sample: Sample, predicted: Float[Array, " modes"], stored: FlowState, valid: Array
    ) -> InversionResult:
        """Make the next Newton steps of the flow and its traction.

        Arguments and results are those of ``Inversion.invert``.
        """
        operators = sample.operators()
        traction = predicted if self.from_prediction else stored.amplitude
        velocity = jnp.where(valid, stored.velocity, operators.response(traction))
        start = FlowState(velocity, traction)
        state, info, slopes, sound, convolutions = self._solved(sample, operators, start)
        found = sound & ~info.stalled
        converged = info.converged & found
        if not self.from_prediction:
            converged |= ~found
        return InversionResult(state, slopes, found, converged, convolutions)


@dataclasses.dataclass(frozen=True)
class FullSolve(Inversion):
    """The solution of the body flow, at the first evaluation of a sample.

    Where flow or slopes are not found, or Cd is not positive, the sample counts as converged
    without a valid label: a second attempt would be the same computation.
    """

    slopes: bool = False
    newton: NewtonSettings = LABEL_FLOW
    warm_starts = False

    def invert(
        self, sample: Sample, predicted: Float[Array, " modes"], stored: FlowState, valid: Array
    ) -> InversionResult:
        """Solve the body flow, and its adjoint for the slopes; the velocity is not kept.

        Arguments and results are those of ``Inversion.invert``.
        """
        state, info, slopes, sound, convolutions = self._solved(sample, sample.operators())
        state = FlowState(stored.velocity, state.amplitude)
        found = sound & info.converged
        return InversionResult(state, slopes, found, jnp.array(True), convolutions)
