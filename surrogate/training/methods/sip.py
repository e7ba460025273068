"""Scale-invariant physics (SIP): the solver is inverted, the network is fitted to the result.

Holl, Koltun, Thuerey 2022 (Scale-invariant Learning by Physics Inversion). Where the gradient of a
loss on the flow would carry the solver's scales into the update, SIP takes the step in traction
space, here to the traction a+ by Newton steps of the body flow, and trains the network on a+, at
its best on the loads of a+ alone, by Adam.
"""

import dataclasses

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.model.network import LoadNetwork
from surrogate.scene.samples import Samples
from surrogate.training.methods.inversion import NewtonSteps
from surrogate.training.methods.labels import TrainingLabels, load_residuals, no_labels
from surrogate.training.methods.method import (
    Batch,
    Evaluator,
    Method,
    adam,
    predict,
    with_cosine_rate,
)
from surrogate.training.physics import Physics


@dataclasses.dataclass(frozen=True)
class LabelRegression(Method):
    """Regression on labels: invert the solver for a batch, then fit the network to all labels.

    The network makes ``network_steps`` of Adam on the labels of all samples. The loss weights
    squared residuals: those of the traction modes, over their scale, by ``modes``; those of the
    outputs log Cd (, Cl / Cd, Cm / Cd) by ``goal**2``; those of their gradients in scaled inputs by
    ``(slopes goal)**2`` (Sobolev training, Czarnecki et al. 2017). At their best, methods have
    ``modes`` 0 and train the outputs alone; then ``goal`` is a common factor, to which Adam is
    invariant. As published, ``modes`` is 1 and ``slopes`` 0.
    """

    batch: int = 8
    network_steps: int = 50
    learning_rate: float = 3e-3
    goal: float = 30.0
    modes: float = 0.0
    slopes: float = 1.0

    @property
    def trains_traction(self) -> bool:
        """Whether all traction modes are trained: those of a loss with ``modes`` above 0."""
        return self.modes > 0

    def init(self, network: LoadNetwork, physics: Physics) -> tuple[optax.OptState, TrainingLabels]:
        """Return Adam's state, and labels that are not valid."""
        return adam(self.learning_rate).init(network.weights), no_labels(physics)

    def update(
        self,
        network: LoadNetwork,
        optimiser: optax.OptState,
        labels: TrainingLabels,
        samples: Samples,
        batch: Batch,
        done: Float[AnyArray, ""],
    ) -> tuple[LoadNetwork, optax.OptState, Float[Array, ""]]:
        """Make ``network_steps`` of Adam on the labels of all samples.

        Arguments and results are those of ``Method.update``; the loss is that before the last step.
        """

        def step(carry, _):
            weights, state = carry
            loss, gradient = jax.value_and_grad(self._loss)(weights, network, labels, samples)
            change, state = adam(self.learning_rate).update(gradient, state)
            return (weights + change, state), loss

        start = network.weights, with_cosine_rate(optimiser, self.learning_rate, done)
        (weights, state), losses = jax.lax.scan(step, start, length=self.network_steps)
        return network.with_weights(weights), state, losses[-1]

    def _loss(self, weights, network, labels, samples):
        """Return the mean loss of all samples with a valid label."""
        everyone, moved = jnp.arange(samples.count), network.with_weights(weights)
        residuals = jax.vmap(lambda k: load_residuals(moved, samples, labels, k))(everyone)
        total = self.goal**2 * jnp.sum(residuals[..., 0] ** 2)
        if self.slopes:
            total += (self.slopes * self.goal) ** 2 * jnp.sum(residuals[..., 1:] ** 2)
        if self.modes:
            scale = network.mode_scale * jnp.abs(labels.tractions[:, :1])
            off = (predict(moved, samples, everyone) - labels.tractions) / scale
            squares = jnp.where(labels.valid[:, None], off**2, 0.0)
            total += self.modes * jnp.sum(squares) / len(off.T)
        return total / jnp.maximum(jnp.sum(labels.valid), 1) / 2


@dataclasses.dataclass(frozen=True)
class ScaleInvariantPhysics(LabelRegression):
    """SIP with stored labels: a few Newton steps at each evaluation, until the label has converged.

    They start from the predicted traction where that is trained, as published; at its best, where
    the loads alone are trained, from the flow of the last evaluation.
    """

    @property
    def evaluator(self) -> Evaluator:
        """Newton steps, from the network's prediction if its traction is trained."""
        return NewtonSteps(slopes=self.slopes > 0, from_prediction=self.trains_traction)
