"""Forecast of the cost of a training: convolutions with the Green's function (G), and seconds."""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from surrogate.flow.flow import Flow
from surrogate.flow.loads import LOADS
from surrogate.model.network import blank_network
from surrogate.scene.cost import CONVOLUTIONS, median_seconds, seconds_per_convolution
from surrogate.training.methods.inversion import NewtonSteps
from surrogate.training.methods.sip import LabelRegression
from surrogate.training.plan import Plan

# Convolutions per evaluation of the methods that, as published, evaluate at every step:
# RESULTS.md, "Cost and accuracy of training": their G over iterations times batch.
EVALUATION = {"dp": 10.0, "hig": 140.0}
EVALUATIONS_OF_A_LABEL = 3  # of a label by a few Newton steps each, until it has converged


class Forecast(NamedTuple):
    """The cost of a training, without compilation.

    Attributes:
      green_applications: convolutions with G of the training bodies' flows.
      flow_s: seconds of these flows on one device.
      network_s: seconds of the network's updates.
      held_out_s: seconds of the held-out flows on one device, which come on top.
    """

    green_applications: float
    flow_s: float
    network_s: float
    held_out_s: float

    @property
    def seconds(self) -> float:
        """Seconds of the training bodies' flows and the network's updates together."""
        return self.flow_s + self.network_s


def forecast(plan: Plan) -> Forecast:
    """Forecast the cost of a training, from averages and a few timed operations."""
    lattice = Flow(plan.scene).domain.lattice
    symmetric = plan.scene.family.body_class.symmetric
    takes = CONVOLUTIONS[plan.scene.dimension, symmetric]
    method = plan.make_method()
    evaluations = EVALUATIONS_OF_A_LABEL if isinstance(method.evaluator, NewtonSteps) else 1
    of_one = takes.flow + evaluations * takes.renewal + (0.0 if plan.published else takes.adjoint)
    work = plan.samples * of_one
    batch = min(method.batch, plan.samples)
    if plan.published and plan.method in EVALUATION:
        work = plan.samples * takes.flow / 2 + plan.iterations * batch * EVALUATION[plan.method]
    steps = method.network_steps if isinstance(method, LabelRegression) else 0
    update_s = _gradient_seconds(plan) * steps if steps else _inverse_seconds(plan, batch)
    takes_s = seconds_per_convolution(lattice.shape, symmetric)
    most = math.inf if plan.budget_s is None else plan.budget_s
    return Forecast(
        min(work, most / takes_s),
        min(work * takes_s, most),
        min(plan.iterations * update_s, most),
        plan.held_out * takes.flow * takes_s,
    )


def _gradient_seconds(plan):
    """Return the seconds of one gradient of the network over all samples."""
    network = _network(plan)
    points = jnp.zeros((plan.samples, network.layers[0].in_features))

    def loss(layers, points):
        for layer in layers:
            points = jnp.tanh(jax.vmap(layer)(points))
        return jnp.sum(points**2)

    gradient = jax.jit(jax.grad(loss))
    return median_seconds(lambda: gradient(network.layers, points))


def _inverse_seconds(plan, batch):
    """Return the seconds of one eigendecomposition of the smaller Gram matrix, 0 without one."""
    if plan.method != "hig":
        return 0.0
    network = _network(plan)
    loads = 1 if network.modes.lift_index is None else len(LOADS)
    best = loads * (1 + network.inputs.low.size)  # the outputs and their gradients
    outcomes = 1 + network.modes.count + (loads > 1) if plan.published else best
    trained = network.weights if plan.published else network.load_weights
    rows = min(trained.size, batch * outcomes)
    matrix = np.random.default_rng(0).normal(size=(rows, rows))
    decompose = jax.jit(jnp.linalg.eigh)
    return median_seconds(lambda: decompose(jnp.asarray(matrix + matrix.T)), 2)


def _network(plan):
    """Return a network of zeros of the plan's sizes, on which alone the seconds depend."""
    shapes = eqx.filter_eval_shape(
        lambda: blank_network(plan.scene, 2 * (plan.width,), jax.random.key(0))
    )
    return jax.tree.map(lambda leaf: jnp.asarray(np.zeros(leaf.shape, leaf.dtype)), shapes)
