"""Differentiable physics (DP): the gradient of a loss on the flow, through the solver's adjoint.

Um, Brand, Fei, Holl, Thuerey 2020 (Solver-in-the-Loop). The network predicts the traction a, the
solver computes the flow that a drives, and the loss is the slip y that remains on the body,

    L = mean over the batch of (|y|^2 + goal^2 (lambda . y / Cd)^2) / 2,

lambda . y being the drag error that the slip means. Adam (Kingma and Ba 2015).
"""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.devices import Sharded
from surrogate.flow.loads import drag, drag_coefficient
from surrogate.flow.solver import steady
from surrogate.flow.solver.adjoint import Effort, slip_weights
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.solver.tangent import slip_adjoint
from surrogate.model.network import LoadNetwork
from surrogate.scene.samples import Samples
from surrogate.training.methods.inversion import NewtonSteps
from surrogate.training.methods.labels import TrainingLabels, load_residuals, no_labels
from surrogate.training.methods.method import (
    Batch,
    EvaluationCost,
    Evaluator,
    Method,
    adam,
    evaluation_cost,
    moment_residual,
    predict,
    with_cosine_rate,
    with_rows,
)
from surrogate.training.physics import Physics, Sample

FLOW = NewtonSettings(3e-3, 8, 30)  # loose: the flow is warm-started and solved again next time
ADJOINT = Effort(0.1, 30)  # one digit: the noise of a batch of 4 samples is larger


class DPState(NamedTuple):
    """The optimiser's state of DP: Adam's, and dy/da of the samples' Oseen flows."""

    adam: optax.OptState
    influence: Float[AnyArray, "samples modes modes"]


@dataclasses.dataclass(frozen=True)
class DifferentiablePhysics(Method):
    """DP at its best: the loss uses the slip linearised about the label.

    An evaluation is a few Newton steps towards the label's traction a+, until it converges. The
    slip of any other traction is M (a - a+), with the influence matrix M of the Oseen flow; the
    drag term is exact, and the drag's slopes are trained with weight ``slopes``. With lift these
    are the terms of all loads.
    """

    batch: int = 64
    learning_rate: float = 1e-2
    goal: float = 30.0
    slopes: float = 1.0
    trains_traction = True

    @property
    def evaluator(self) -> Evaluator:
        """Newton steps from the flow of the last evaluation."""
        return NewtonSteps(slopes=self.slopes > 0)

    def init(self, network: LoadNetwork, physics: Physics) -> tuple[DPState, TrainingLabels]:
        """Return Adam's state with the Oseen flows' influence matrices, and no valid labels."""
        state = adam(self.learning_rate).init(network.weights)
        return DPState(state, physics.influence), no_labels(physics)

    def update(
        self,
        network: LoadNetwork,
        optimiser: DPState,
        labels: TrainingLabels,
        samples: Samples,
        batch: Batch,
        done: Float[AnyArray, ""],
    ) -> tuple[LoadNetwork, DPState, Float[Array, ""]]:
        """Make one step of Adam on the loss of the batch's samples with a valid label.

        Arguments and results are those of ``Method.update``.
        """
        valid = labels.valid[batch]

        def loss_of(weights):
            moved = network.with_weights(weights)
            difference = predict(moved, samples, batch) - labels.tractions[batch]
            slip = jnp.einsum("bym,bm->by", optimiser.influence[batch], difference)
            residuals = jax.vmap(lambda k: load_residuals(moved, samples, labels, k))(batch)
            scale = self.goal * jnp.append(1.0, jnp.full(residuals.shape[2] - 1, self.slopes))
            losses = jnp.sum(slip**2, axis=1) + jnp.sum((scale * residuals) ** 2, axis=(1, 2))
            return jnp.sum(jnp.where(valid, losses, 0.0)) / jnp.maximum(jnp.sum(valid), 1) / 2

        loss, gradient = jax.value_and_grad(loss_of)(network.weights)
        network, state = adam_step(network, optimiser.adam, gradient, self.learning_rate, done)
        return network, optimiser._replace(adam=state), loss


class LossGradient(NamedTuple):
    """The loss of a sample, its gradient in the traction, its validity, and convolutions spent."""

    gradient: Float[AnyArray, "*samples modes"]
    loss: Float[AnyArray, "*samples"]
    valid: Bool[AnyArray, "*samples"]
    convolutions: Int[AnyArray, "*samples"]

    def pending(self, batch: Batch) -> Bool[np.ndarray, " batch"]:
        """Return True for all samples: every step needs the flows of its own tractions."""
        return np.ones(len(batch), bool)


@dataclasses.dataclass(frozen=True)
class PublishedDifferentiablePhysics(Method, Evaluator):
    """DP as published: each step solves the flows that the predicted tractions drive.

    Warm-started from the sample's last flow, with two adjoint solves per sample.
    """

    batch: int = 4
    learning_rate: float = 1e-2
    goal: float = 3.0
    trains_traction = True
    warm_starts = True

    @property
    def evaluator(self) -> Evaluator:
        """The method itself."""
        return self

    def init(self, network: LoadNetwork, physics: Physics) -> tuple[optax.OptState, LossGradient]:
        """Return Adam's state, and a store of losses and gradients that are zero and not valid."""
        count, modes = physics.tractions.shape
        none, zeros = jnp.zeros(count, int), jnp.zeros(count)
        blank = LossGradient(jnp.zeros((count, modes)), zeros, none.astype(bool), none)
        return adam(self.learning_rate).init(network.weights), blank

    def evaluate(
        self,
        network: LoadNetwork,
        physics: Physics,
        labels: LossGradient,
        velocities: Sharded,
        batch: Batch,
    ) -> tuple[LossGradient, Sharded, EvaluationCost]:
        """Solve the flows that the predicted tractions drive; store losses and their gradients.

        Arguments and results are those of ``Evaluator.evaluate``.
        """
        predicted = predict(network, physics.samples, batch)
        found = physics.evaluate(batch, velocities, self._differentiate, predicted)
        labels = with_rows(labels, batch, found.results)
        return labels, found.states, evaluation_cost(found, physics, batch)

    def _differentiate(
        self, sample: Sample, velocity: Array, traction: Float[Array, " modes"]
    ) -> tuple[LossGradient, Array]:
        """Return a sample's loss, its gradient in the traction, and the velocity to start from."""
        domain, operators = sample.domain, sample.operators()
        start = sample.start(operators, velocity)
        velocity, info = steady.forced_flow(domain, operators, traction, start, FLOW)
        state = FlowState(velocity, traction)
        slip = steady.slip_residual(operators, state)
        weights, work = slip_weights(drag, domain, operators, state, ADJOINT)
        scale = self.goal / jnp.abs(drag_coefficient(sample.oseen))
        residual = scale * (weights @ slip)
        by_slip = slip + scale * residual * weights
        gradient, work_too = slip_adjoint(domain, operators, state, by_slip, ADJOINT)
        # Adjoints may miss ADJOINT's tolerance: a rough gradient is still one for Adam.
        valid = info.converged & jnp.all(jnp.isfinite(gradient))
        convolutions = (
            info.convolutions + work.convolutions + work_too.convolutions + sample.renewal
        )
        result = LossGradient(gradient, (slip @ slip + residual**2) / 2, valid, convolutions)
        return result, jnp.where(valid, velocity, 0.0)

    def update(
        self,
        network: LoadNetwork,
        optimiser: optax.OptState,
        labels: LossGradient,
        samples: Samples,
        batch: Batch,
        done: Float[AnyArray, ""],
    ) -> tuple[LoadNetwork, optax.OptState, Float[Array, ""]]:
        """Make one step of Adam by the stored gradients in the traction of the batch.

        Arguments and results are those of ``Method.update``.
        """
        gradient, loss, valid, _ = jax.tree.map(lambda leaf: leaf[batch], labels)
        count = jnp.maximum(jnp.sum(valid), 1)
        gradient = jnp.where(valid[:, None], gradient, 0.0) / count

        def traction_of(weights):
            return predict(network.with_weights(weights), samples, batch)

        def moment_loss(weights):
            moved = network.with_weights(weights)
            residuals = jax.vmap(lambda k: moment_residual(moved, samples, k))(batch)
            squares = jnp.where(valid[:, None], residuals, 0.0) ** 2
            return self.goal**2 * jnp.sum(squares) / count / 2

        gradient = jax.vjp(traction_of, network.weights)[1](gradient)[0]
        gradient += jax.grad(moment_loss)(network.weights)
        network, state = adam_step(network, optimiser, gradient, self.learning_rate, done)
        return network, state, jnp.sum(jnp.where(valid, loss, 0.0)) / count


def adam_step(
    network: LoadNetwork,
    state: optax.OptState,
    gradient: Float[Array, " weights"],
    learning_rate: float,
    done: Array,
) -> tuple[LoadNetwork, optax.OptState]:
    """Make one step of Adam, whose learning rate follows its cosine schedule.

    Args:
      network: before the step.
      state: of Adam, from ``adam(learning_rate).init``.
      gradient: of the loss in ``network.weights``.
      learning_rate: at the start of the training.
      done: fraction of the training that is over.

    Returns:
      The network after the step, and Adam's new state.
    """
    state = with_cosine_rate(state, learning_rate, done)
    change, state = adam(learning_rate).update(gradient, state)
    return network.with_weights(network.weights + change), state
