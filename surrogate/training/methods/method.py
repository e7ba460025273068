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
from surrogate.body.skin import HALVES, SkinNodes
from surrogate.devices import Sharded
from surrogate.flow.loads import drag_coefficient, moment
from surrogate.model.network import LoadNetwork
from surrogate.partition import Evaluated
from surrogate.scene.samples import Samples
from surrogate.training.physics import Physics

# Nodes, by the dimension, on which the moment of a traction is integrated, exactly.
MOMENT_NODES = {2: 128, 3: SkinNodes(32, 32, HALVES)}
Batch = Int[AnyArray, " batch"]  # indices of samples


@runtime_checkable
class LabelStore(Protocol):
    """Results of all evaluations so far: arrays with one row per sample, on every device."""

    def pending(self, batch: Batch) -> Bool[np.ndarray, " batch"]:
        """Return for each sample of a batch whether another evaluation could improve its label."""
        ...


class EvaluationCost(NamedTuple):
    """The cost of an evaluation: its convolutions, failed samples, convolutions of idle devices."""

    convolutions: Int[AnyArray, ""]
    failed: Int[AnyArray, ""]
    idle_work: Int[AnyArray, ""]


class Evaluator(abc.ABC):
    """The evaluation of samples by the flow solver; a frozen dataclass of its settings.

    Methods whose evaluators are equal share one compiled program. JAX traces ``evaluate``.

    Attributes:
      warm_starts: whether an evaluation starts from the velocity of the sample's last one.
    """

    warm_starts: bool

    @abc.abstractmethod
    def evaluate(
        self,
        network: LoadNetwork,
        physics: Physics,
        labels: LabelStore,
        velocities: Sharded,
        batch: Batch,
    ) -> tuple[LabelStore, Sharded, EvaluationCost]:
        """Evaluate the samples of a chunk of a batch with the flow solver.

        Runs inside ``shard_map``: each device has its own rows of the chunk in ``velocities`` and
        in ``physics.operators``; everything else is replicated.

        Args:
          network: before the update.
          physics: the flow solver of the samples, see ``Physics.evaluate``.
          labels: the label store of all samples.
          velocities: last velocities of the chunk's samples, zero before their first flow; each of
            the shape ``physics.velocity_shape``, or (1,) without ``warm_starts``.
          batch: indices of the chunk's samples; the index ``physics.count`` is padding.

        Returns:
          The label store with new rows for the chunk, the new velocities in the same order and
          shape, and the cost.
        """


class Method(abc.ABC):
    """A training method; implementations are frozen dataclasses of its settings.

    JAX traces ``init`` and ``update``.

    Attributes:
      batch: number of samples per step.
      trains_traction: whether all traction modes of the network are trained, or the loads alone.
    """

    batch: int
    trains_traction: bool

    @property
    @abc.abstractmethod
    def evaluator(self) -> Evaluator:
        """The evaluation of a batch of samples that precedes the update."""

    @abc.abstractmethod
    def init(self, network: LoadNetwork, physics: Physics) -> tuple[PyTree, LabelStore]:
        """Return the optimiser's state and the label store before the first step.

        Args:
          network: the initial network.
          physics: the flow solver of all samples and their Oseen flows.

        Returns:
          The optimiser's state, any pytree of arrays, and the label store, with one row per sample.
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
        """Update the network once, from the labels of a batch or of all samples.

        Runs on one device.

        Args:
          network: before the update.
          optimiser: the optimiser's state.
          labels: the label store of all samples.
          samples: all samples.
          batch: indices of the samples of this step, without padding.
          done: fraction of the training that is over, for schedules.

        Returns:
          The new network, the optimiser's new state, and the loss before the update (of
          several inner steps: before the last).
        """


def with_rows(labels: LabelStore, batch: Batch, rows: PyTree) -> LabelStore:
    """Return the label store with new rows for the samples of a batch.

    Args:
      labels: the label store of all samples.
      batch: indices of the samples; rows of indices beyond the last sample are dropped.
      rows: the new rows, a pytree like the label store with as many rows as the batch.
    """
    return jax.tree.map(lambda all, new: all.at[batch].set(new), labels, rows)


def evaluation_cost(found: Evaluated, physics: Physics, batch: Batch) -> EvaluationCost:
    """Return the cost of a batch of evaluations, whose results have ``valid`` and ``convolutions``.

    Padding counts neither as failed nor as work.

    Args:
      found: the evaluated batch; ``convolutions`` is the number of each sample.
      physics: the flow solver of the samples.
      batch: indices of the samples; the index ``physics.count`` is padding.
    """
    failed = ~found.results.valid & (batch < physics.count)
    return EvaluationCost(jnp.sum(found.results.convolutions), jnp.sum(failed), found.idle_work)


def adam(learning_rate: float) -> optax.GradientTransformation:
    """Return the optimiser Adam (Kingma and Ba 2015), whose learning rate is part of its state."""
    return optax.inject_hyperparams(optax.adam)(learning_rate)


def with_cosine_rate(state: optax.OptState, learning_rate: float, done: Array) -> optax.OptState:
    """Return Adam's state with its learning rate, which decays to zero by a cosine.

    Loshchilov, Hutter 2017. The rate follows the fraction ``done`` of the training, since
    trainings may be limited by time.

    Args:
      state: of ``adam``.
      learning_rate: at the start of the training.
      done: fraction of the training that is over.
    """
    rate = learning_rate * (1 + jnp.cos(jnp.pi * done)) / 2
    return state._replace(hyperparams=state.hyperparams | {"learning_rate": rate})


def predict(network: LoadNetwork, samples: Samples, batch: Batch) -> Float[Array, "batch modes"]:
    """Return the network's traction modes for a batch of samples."""
    return jax.vmap(network.traction)(*samples.at(batch))


def moment_residual(
    network: LoadNetwork, samples: Samples, index: Int[Array, ""]
) -> Float[Array, " moments"]:
    """Return Cm / Cd by the network minus that of its traction; empty where there is no lift.

    Methods as published train the traction, which has drag and lift among its modes; by this
    residual the network's moment follows it.

    Args:
      network: whose moment is compared.
      samples: all samples.
      index: of the sample.
    """
    if network.modes.lift_index is None:
        return jnp.zeros(0)
    parameters, reynolds = samples.at(index)
    traction = jax.lax.stop_gradient(network.traction(parameters, reynolds))
    body_class = network.inputs.body_class
    markers = body_class.markers(parameters, MOMENT_NODES[body_class.dimension])
    of_traction = moment(network.modes, traction, markers) / drag_coefficient(traction)
    return network.outputs(network.inputs(parameters, reynolds))[2:] - of_traction
