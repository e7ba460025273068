"""Half-inverse gradients (HIG): the Jacobian of a batch is inverted half way.

Schnell, Holl, Thuerey 2022 (Half-Inverse Gradients for Physical Deep Learning). With the residuals
y of a batch of B samples and J = dy/d(weights) / sqrt(B) = U S V^T, the update of the weights is

    -eta / (1 + iteration / decay) V S^-kappa U^T y / sqrt(B),   kappa = 1/2,

singular values below tau S_max being dropped. As published, y are the slips of the flows that the
predicted tractions drive; at its best, residuals of log Cd (, Cl / Cd, Cm / Cd) and of their
gradients in shape and Re.
"""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray, by_lapack
from surrogate.devices import Sharded
from surrogate.flow.loads import drag_coefficient
from surrogate.flow.solver import steady
from surrogate.flow.solver.adjoint import Effort
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.solver.tangent import slip_jacobian
from surrogate.model.network import LoadNetwork
from surrogate.scene.samples import Samples
from surrogate.training.methods.inversion import LABEL_FLOW, FullSolve
from surrogate.training.methods.labels import TrainingLabels, load_residuals, no_labels
from surrogate.training.methods.method import (
    Batch,
    EvaluationCost,
    Evaluator,
    Method,
    evaluation_cost,
    moment_residual,
    predict,
    with_rows,
)
from surrogate.training.methods.partial_inverse import samples_with_residuals, weight_step
from surrogate.training.physics import Physics, Sample

FLOW = NewtonSettings(1e-4, 10, 40)
TANGENT = Effort(1e-2, 30)


@dataclasses.dataclass(frozen=True)
class HalfInverseGradients(Method):
    """HIG at its best: each sample's flow and adjoint are solved once, in its first batch.

    The optimiser's state is the number of steps so far.
    ``kappa`` 1 is Gauss-Newton, -1 gradient descent. With ``vectors``, that many Lanczos vectors
    replace the dense inverse, and the Jacobian is never formed. Steps are kept within 1.5 times
    Gauss-Newton's (``partial_inverse``), without which networks of three loads oscillate; those of
    drag alone have no singular value so large that it matters.
    ``batch`` exceeds the presets' samples, so that all are one batch.
    """

    batch: int = 1024
    eta: float = 1.0
    decay: float = 120.0
    tau: float = 1e-5
    kappa: float = 0.5
    vectors: int | None = None
    newton: NewtonSettings = LABEL_FLOW
    trains_traction = False

    @property
    def evaluator(self) -> Evaluator:
        """The full solution of the body flow and its adjoint."""
        return FullSolve(slopes=True, newton=self.newton)

    def init(
        self, network: LoadNetwork, physics: Physics
    ) -> tuple[Int[AnyArray, ""], TrainingLabels]:
        """Return the number of steps so far, 0, and labels that are not valid."""
        return jnp.array(0), no_labels(physics)

    def update(
        self,
        network: LoadNetwork,
        optimiser: Int[AnyArray, ""],
        labels: TrainingLabels,
        samples: Samples,
        batch: Batch,
        done: Float[AnyArray, ""],
    ) -> tuple[LoadNetwork, Int[AnyArray, ""], Float[Array, ""]]:
        """Make one half-inverse step on the residuals of the batch's outputs and their gradients.

        Arguments and results are those of ``Method.update``.
        """

        def residuals(weights, index):
            moved = network.with_load_weights(weights)
            return load_residuals(moved, samples, labels, index).ravel()

        weights = network.load_weights
        y = jax.vmap(residuals, (None, 0))(weights, batch)
        how = self.tau, self.kappa, self.vectors
        step = weight_step(residuals, weights, batch, y, *how, limited=True)
        rate = self.eta / (1 + optimiser / self.decay)
        network = network.with_load_weights(weights - rate * step)
        return network, optimiser + 1, jnp.mean(jnp.sum(y**2, axis=1)) / 2


class ForcedFlowResult(NamedTuple):
    """Slip of the flow that a traction drives, its dy/da, validity and convolutions."""

    slip: Float[Array, " modes"]
    influence: Float[Array, "modes modes"]
    valid: Bool[Array, ""]
    convolutions: Int[Array, ""]


class LinearisedSlip(NamedTuple):
    """Last residuals y of all samples, the drag error among them, and their derivatives dy/da.

    Zero for samples whose evaluation failed.
    """

    y: Float[AnyArray, "samples outcomes"]
    by_traction: Float[AnyArray, "samples outcomes modes"]

    def pending(self, batch: Batch) -> Bool[np.ndarray, " batch"]:
        """Return True for all samples: every step needs the flows of its own tractions."""
        return np.ones(len(batch), bool)


@dataclasses.dataclass(frozen=True)
class PublishedHalfInverseGradients(Method, Evaluator):
    """HIG as published: each step solves the flows that the predicted tractions drive.

    With one tangent solve per traction mode; the drag error that the slip means is one more
    residual, of weight ``goal``. Samples whose flow or tangents are not found are left out of the
    step and restart from their Oseen flow.
    """

    batch: int = 32
    eta: float = 1.0
    decay: float = 60.0
    tau: float = 1e-3
    kappa: float = 0.5
    goal: float = 3.0
    trains_traction = True
    warm_starts = True

    @property
    def evaluator(self) -> Evaluator:
        """The method itself."""
        return self

    def init(
        self, network: LoadNetwork, physics: Physics
    ) -> tuple[Int[AnyArray, ""], LinearisedSlip]:
        """Return the number of steps so far, 0, and a store of residuals that are zero."""
        count, modes = physics.tractions.shape
        blank = jnp.zeros((count, modes + 1)), jnp.zeros((count, modes + 1, modes))
        return jnp.array(0), LinearisedSlip(*blank)

    def evaluate(
        self,
        network: LoadNetwork,
        physics: Physics,
        labels: LinearisedSlip,
        velocities: Sharded,
        batch: Batch,
    ) -> tuple[LinearisedSlip, Sharded, EvaluationCost]:
        """Solve the flows that the predicted tractions drive; store slips and their derivatives.

        Arguments and results are those of ``Evaluator.evaluate``.
        """
        predicted = predict(network, physics.samples, batch)
        found = physics.evaluate(batch, velocities, _linearise, predicted)
        results, drag = found.results, drag_coefficient(physics.tractions[batch])
        y, by_traction = with_goal_row(results.slip, results.influence, self.goal, drag)
        finite = jnp.all(jnp.isfinite(y), axis=1) & jnp.all(jnp.isfinite(by_traction), axis=(1, 2))
        results = results._replace(valid=results.valid & finite)
        y = jnp.where(results.valid[:, None], y, 0.0)
        by_traction = jnp.where(results.valid[:, None, None], by_traction, 0.0)
        labels = with_rows(labels, batch, LinearisedSlip(y, by_traction))
        found = found._replace(results=results)
        return labels, found.states, evaluation_cost(found, physics, batch)

    def update(
        self,
        network: LoadNetwork,
        optimiser: Int[AnyArray, ""],
        labels: LinearisedSlip,
        samples: Samples,
        batch: Batch,
        done: Float[AnyArray, ""],
    ) -> tuple[LoadNetwork, Int[AnyArray, ""], Float[Array, ""]]:
        """Make one half-inverse step on the slips of the batch and the weighted drag errors.

        Where there is lift the moment is one more residual (``moment_residual``). Arguments and
        results are those of ``Method.update``.
        """

        def moment(network, index):
            found = jnp.any(labels.y[index] != 0)
            return self.goal * jnp.where(found, moment_residual(network, samples, index), 0.0)

        def residuals(weights, index):
            moved = network.with_weights(weights)
            slips = labels.by_traction[index] @ moved.traction(*samples.at(index))
            return jnp.append(slips, moment(moved, index))

        moments = jax.vmap(lambda index: moment(network, index))(batch)
        y = jnp.append(labels.y[batch], moments, axis=1)

        step = weight_step(residuals, network.weights, batch, y, self.tau, self.kappa)
        rate = self.eta / (1 + optimiser / self.decay)
        loss = jnp.sum(y**2) / samples_with_residuals(y) / 2
        return network.with_weights(network.weights - rate * step), optimiser + 1, loss


def _linearise(sample: Sample, velocity: Array, traction: Array) -> tuple[ForcedFlowResult, Array]:
    """Return slip and influence matrix of a driven flow, and the velocity to start from."""
    domain, operators = sample.domain, sample.operators()
    start = sample.start(operators, velocity)
    velocity, info = steady.forced_flow(domain, operators, traction, start, FLOW)
    state = FlowState(velocity, traction)
    slip = steady.slip_residual(operators, state)
    matrix, work = slip_jacobian(domain, operators, state, TANGENT)
    valid = info.converged & work.converged
    convolutions = info.convolutions + work.convolutions + sample.renewal
    result = ForcedFlowResult(slip, matrix, valid, convolutions)
    return result, jnp.where(valid, velocity, 0.0)


def with_goal_row(
    slip: Float[Array, "batch modes"],
    influence: Float[Array, "batch modes modes"],
    goal: float,
    drag: Float[AnyArray, " batch"],
) -> tuple[Float[Array, "batch outcomes"], Float[Array, "batch outcomes modes"]]:
    """Append the weighted drag error goal lambda . y / Cd and its derivative in the traction.

    lambda solves M^T lambda = -dCd/da, so that the derivative of the row is known without it.

    Args:
      slip: y of the flows that the tractions drive.
      influence: M = dy/da of the same flows.
      goal: weight of the drag error.
      drag: Cd by which the errors are divided, that of the Oseen flows.

    Returns:
      y with the drag error as last entry, and its derivatives in the traction: M with one more row.
    """
    by_traction = jax.grad(drag_coefficient)(slip[0])
    row = -goal * by_traction / jnp.abs(drag)[:, None]
    error = jnp.einsum("bm,bm->b", row, jax.vmap(by_lapack(jnp.linalg.solve))(influence, slip))
    y = jnp.concatenate([slip, error[:, None]], axis=1)
    return y, jnp.concatenate([influence, row[:, None]], axis=1)
