"""Scale-invariant physics: the solver is inverted, the network learns the inverse's answer.

Each physics step moves a batch of samples by one coupled Newton step of body flow,
a+ = a - (dy/da)^+ y, started at the network's prediction; the network then takes several Adam
steps on L = mean |(a - stop(a+)) / scale|^2 / 2 over all targets kept so far, the drag's mode
weighted by the goal. A sample whose drag no longer moves is settled and not inverted again.
Holl, Koltun, Thuerey 2022 (Scale-invariant LearnerState by Physics Inversion).
"""

import jax
import jax.numpy as jnp

from surrogate.flow.solver.adjoint import Effort
from surrogate.training.methods.method import Method, adam_that_ends, predict, slowed
from surrogate.training.methods.targets import (
    Inversion,
    drag_residuals,
    evaluate_by_inversion,
    no_labels,
    one_step_inversion,
)


def scale_invariant_physics(
    batch: int = 8,
    network_steps: int = 50,
    learning_rate: float = 3e-3,
    goal: float = 30.0,
    settle: float = 1e-4,
    effort: Effort = Effort(1e-2, 30),
    modes: float = 0.0,
    slopes: float = 1.0,
) -> Method:
    """SIP with kept targets: one coupled step per sample, ``network_steps`` on all targets.

    At its best it learns what the drag needs and the slopes of settled samples; as published the
    whole traction (``modes`` 1) and no ``slopes``.
    """
    invert = one_step_inversion(settle, effort, slopes=slopes > 0)
    return imitation(invert, batch, network_steps, learning_rate, goal, modes, slopes)


def imitation(
    invert: Inversion,
    batch: int,
    network_steps: int,
    learning_rate: float,
    goal: float,
    modes: float,
    slopes: float,
) -> Method:
    """Invert the solver for a batch, then Adam towards all targets so far.

    The loss weights the squared misses of the modes by ``modes``, of log Cd by ``goal**2``, of
    its slopes in scaled inputs by ``(slopes goal)**2``: what the adjoint of a settled flow tells of
    its neighbours (Sobolev training, Czarnecki et al. 2017).
    """
    optimiser = adam_that_ends(learning_rate)

    def init(network, physics):
        return optimiser.init(network.weights), no_labels(physics)

    def learn(network, adam, targets, samples, batch, done):
        everyone = jnp.arange(samples.count)
        scale = network.spread * jnp.abs(targets.tractions[:, :1])

        def loss_of(weights):
            moved = network.with_weights(weights)
            misses = jax.vmap(lambda k: drag_residuals(moved, samples, targets, k))(everyone)
            total = goal**2 * jnp.sum(misses[:, 0] ** 2)
            if slopes:
                total += (slopes * goal) ** 2 * jnp.sum(misses[:, 1:] ** 2)
            if modes:
                off = (predict(moved, samples, everyone) - targets.tractions) / scale
                total += (
                    modes * jnp.sum(jnp.where(targets.known[:, None], off**2, 0.0)) / len(off.T)
                )
            return total / jnp.maximum(jnp.sum(targets.known), 1) / 2

        def step(carry, _):
            weights, adam = carry
            loss, gradient = jax.value_and_grad(loss_of)(weights)
            change, adam = optimiser.update(gradient, adam)
            return (weights + change, adam), loss

        start = network.weights, slowed(adam, learning_rate, done)
        (weights, adam), losses = jax.lax.scan(step, start, length=network_steps)
        return network.with_weights(weights), adam, losses[-1]

    return Method(init, evaluate_by_inversion(invert), learn, batch)
