"""Scale-invariant physics (SIP): the solver is inverted, the network is fitted to the result.

Holl, Koltun, Thuerey 2022 (Scale-invariant Learning by Physics Inversion). Where the gradient of a
loss on the flow would carry the solver's scales into the update, SIP takes the step in traction
space, here a+ = a - (dy/da)^-1 y by one coupled Newton step, and trains the network on a+ by Adam.
"""

import abc
import dataclasses

import jax
import jax.numpy as jnp

from surrogate.flow.solver.adjoint import Effort
from surrogate.training.methods.labels import CoupledStep, Inversion, load_residuals, no_labels
from surrogate.training.methods.method import Method, adam, predict, with_cosine_rate


@dataclasses.dataclass(frozen=True)
class LabelRegression(Method):
    """Invert the solver for a batch, then ``network_steps`` of Adam on the labels of all samples.

    The loss weights squared residuals: those of the traction modes, over their scale, by
    ``modes``; that of log Cd by ``goal**2``; those of its gradient in scaled inputs by
    ``(slopes goal)**2`` (Sobolev training, Czarnecki et al. 2017). At their best, methods have
    ``modes`` 0 and train the drag alone; then ``goal`` is a common factor, to which Adam is
    invariant. As published, ``modes`` is 1 and ``slopes`` 0.
    """

    batch: int = 8
    network_steps: int = 50
    learning_rate: float = 3e-3
    goal: float = 30.0
    modes: float = 0.0
    slopes: float = 1.0

    @property
    @abc.abstractmethod
    def inversion(self) -> Inversion:
        """How labels are computed."""

    @property
    def trains_traction(self) -> bool:
        return self.modes > 0

    @property
    def warm_starts(self) -> bool:
        return self.inversion.warm_starts

    def init(self, network, physics):
        return adam(self.learning_rate).init(network.weights), no_labels(physics)

    def evaluate(self, network, physics, labels, velocities, batch):
        return self.inversion.evaluate(network, physics, labels, velocities, batch)

    def update(self, network, optimiser, labels, samples, batch, done):
        def step(carry, _):
            weights, state = carry
            loss, gradient = jax.value_and_grad(self._loss)(weights, network, labels, samples)
            change, state = adam(self.learning_rate).update(gradient, state)
            return (weights + change, state), loss

        start = network.weights, with_cosine_rate(optimiser, self.learning_rate, done)
        (weights, state), losses = jax.lax.scan(step, start, length=self.network_steps)
        return network.with_weights(weights), state, losses[-1]

    def _loss(self, weights, network, labels, samples):
        """Mean loss of all samples with a valid label."""
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
    """SIP with stored labels: one coupled Newton step per evaluation.

    A label has converged when its drag changes by less than ``tolerance``; ``effort`` limits the
    Krylov solve of a step.
    """

    tolerance: float = 1e-4
    effort: Effort = Effort(1e-2, 30)

    @property
    def inversion(self) -> Inversion:
        return CoupledStep(self.slopes > 0, self.tolerance, self.effort)
