"""The interface of a training method: evaluate samples with the flow solver, update the network.

A training step evaluates those samples of a batch whose labels are missing or may still improve
and then updates the network's weights from the label store (``surrogate/training/step.py``).
"""

import abc
from typing import NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.arrays import AnyArray
from surrogate.devices import Sharded
from surrogate.flow.loads import drag_coefficient, moment
from surrogate.model.network import LoadNetwork
from surrogate.partition import Evaluated
from surrogate.scene.samples import Samples
from surrogate.training.physics import Physics

MOMENT_NODES = 128  # of the contour on which the moment of a traction is integrated, exactly
Batch = Int[AnyArray, " batch"]  # indices of samples


@runtime_checkable
class LabelStore(Protocol):
    """Results of all evaluations so far: arrays with one row per sample, on every device."""

    def pending(self, batch: Batch) -> Bool[np.ndarray, " batch"]:
        """Whether evaluating a sample again could improve its label."""
        ...


class EvaluationCost(NamedTuple):
    """Convolutions of an evaluation, samples that failed, and convolutions of idle devices."""

    products: Int[AnyArray, ""]
    failed: Int[AnyArray, ""]
    idle_work: Int[AnyArray, ""]


class Method(abc.ABC):
    """A training method; implementations are frozen dataclasses of its settings.

    ``batch`` is the number of samples per step; ``trains_traction`` says whether all traction modes
    of the network are trained, or the drag alone; ``warm_starts`` whether an evaluation starts from
    the velocity of the sample's last one. JAX traces ``init``, ``evaluate``, ``update``.
    """

    batch: int
    trains_traction: bool
    warm_starts: bool

    @abc.abstractmethod
    def init(self, network: LoadNetwork, physics: Physics) -> tuple[PyTree, LabelStore]:
        """The optimiser's state and the label store before the first step."""

    @abc.abstractmethod
    def evaluate(
        self,
        network: LoadNetwork,
        physics: Physics,
        labels: LabelStore,
        velocities: Sharded,
        batch: Batch,
    ) -> tuple[LabelStore, Sharded, EvaluationCost]:
        """Evaluate a chunk of a batch: new labels, new velocities, cost.

        Runs inside ``shard_map``: each device has its own rows of the chunk in ``velocities`` and
        in ``physics.operators``; everything else is replicated.
        """

    @abc.abstractmethod
    def update(
        self,
        network: LoadNetwork,
        optimiser: PyTree,
        labels: LabelStore,
        samples: Samples,
        batch: Batch,
        done: Float[AnyArray, ""],
    ) -> tuple[LoadNetwork, PyTree, Float[Array, ""]]:
        """Update the network: new network, new optimiser state, the loss before.

        Runs on one device. ``done`` is the fraction of the training that is over, for schedules.
        """


def evaluation_cost(found: Evaluated, physics: Physics, batch: Batch) -> EvaluationCost:
    """The cost of a batch of evaluations, whose results have fields ``valid`` and ``products``.

    Padding counts neither as failed nor as work.
    """
    failed = ~found.results.valid & (batch < physics.count)
    return EvaluationCost(jnp.sum(found.results.products), jnp.sum(failed), found.idle_work)


def adam(learning_rate: float) -> optax.GradientTransformation:
    """Adam (Kingma and Ba 2015) whose learning rate is part of its state."""
    return optax.inject_hyperparams(optax.adam)(learning_rate)


def with_cosine_rate(state: optax.OptState, learning_rate: float, done: Array) -> optax.OptState:
    """Adam's state with a learning rate that decays to zero by a cosine (Loshchilov, Hutter 2017).

    It follows the fraction ``done`` of the training, since trainings may be limited by time.
    """
    state.hyperparams["learning_rate"] = learning_rate * (1 + jnp.cos(jnp.pi * done)) / 2
    return state


def predict(network: LoadNetwork, samples: Samples, batch: Batch) -> Float[Array, "batch modes"]:
    """The network's traction modes of a batch of samples."""
    return jax.vmap(network.traction)(*samples.at(batch))


def moment_residual(
    network: LoadNetwork, samples: Samples, index: Int[Array, ""]
) -> Float[Array, " moments"]:
    """Cm / Cd by the network minus that of its traction; empty where there is no lift.

    Methods as published train the traction, which has drag and lift among its modes; by this
    residual the network's moment follows it.
    """
    if network.modes.lift_index is None:
        return jnp.zeros(0)
    parameters, reynolds = samples.at(index)
    traction = jax.lax.stop_gradient(network.traction(parameters, reynolds))
    markers = network.inputs.body_class.markers(parameters, MOMENT_NODES)
    of_traction = moment(network.modes, traction, markers) / drag_coefficient(traction)
    return network.outputs(network.inputs(parameters, reynolds))[2:] - of_traction
