"""One training step as compiled programs: evaluate a batch on all devices, update on one.

The rows of a chunk of the batch are copied out of the stored fields, evaluated and copied back, so
that no program holds a second copy of the fields of all bodies. Once every label of the batch has
converged, a step is the update alone.
"""

import dataclasses
import functools
from collections.abc import Iterator
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Bool, PyTree

from surrogate.arrays import AnyArray
from surrogate.compilation import same_options
from surrogate.devices import Devices, Sharded
from surrogate.model.network import LoadNetwork
from surrogate.partition import Partition
from surrogate.training.methods.method import (
    Batch,
    EvaluationCost,
    Evaluator,
    LabelStore,
    Method,
)
from surrogate.training.physics import Physics

NO_COST = EvaluationCost(0, 0, 0)
PROGRAMS = 4  # evaluations that are kept compiled: more than methods at their best have


class LearnerState(NamedTuple):
    """The state that a step changes: network, optimiser's state, labels, velocities of all samples.

    Velocities are zero until an evaluation succeeds; where the method does not start from them, one
    zero stands for each.
    """

    network: LoadNetwork
    optimiser: PyTree
    labels: LabelStore
    velocities: Sharded

    def placed(self, devices: Devices) -> "LearnerState":
        """Return the state with the labels replicated on the mesh and the velocities sharded."""
        labels, velocities = devices.place((self.labels, self.velocities))
        return self._replace(labels=labels, velocities=velocities)


class Step(NamedTuple):
    """The compiled programs of a step: copy rows out, evaluate, copy rows back, update."""

    physics: Physics
    fetch: jax.stages.Compiled
    evaluate: jax.stages.Compiled
    put_back: jax.stages.Compiled
    update: jax.stages.Compiled

    def evaluations(
        self, state: LearnerState, batch: Batch, evaluated: Bool[AnyArray, " samples"]
    ) -> Iterator[tuple[LearnerState, Batch, EvaluationCost]]:
        """Evaluate a batch chunk by chunk; yield the state, the samples and the cost after each.

        Nothing is evaluated if all labels of the batch have converged.

        Args:
          state: before the step.
          batch: indices of samples.
          evaluated: samples that this step has evaluated already, before an interruption.
        """
        if not np.any(state.labels.pending(batch)):
            return
        partition = self.physics.partition
        network = partition.devices.place(jax.tree.map(np.asarray, state.network))
        for chunk in partition.chunks(batch, evaluated):
            state, cost = self._evaluated(state, partition.devices.place(chunk), network)
            yield state, chunk[chunk < self.physics.count], cost

    def updated(self, state: LearnerState, batch: Batch, done: float) -> tuple[LearnerState, Array]:
        """Return the state with an updated network, and the loss that ``Method.update`` returns.

        Args:
          state: after the evaluations of the step.
          batch: indices of samples.
          done: fraction of the training that is over.
        """
        devices = self.physics.partition.devices
        labels, samples = devices.local((state.labels, self.physics.samples))
        network, optimiser, loss = self.update(
            state.network, state.optimiser, labels, samples, batch, np.asarray(done)
        )
        return state._replace(network=network, optimiser=optimiser), loss

    def _evaluated(self, state, batch, network):
        partition, stored = self.physics.partition, (self.physics.operators, state.velocities)
        operators, velocities = self.fetch(partition, batch, stored)
        physics = dataclasses.replace(self.physics, operators=operators)
        labels, velocities, cost = self.evaluate(network, physics, state.labels, velocities, batch)
        velocities = self.put_back(partition, batch, state.velocities, velocities)
        return state._replace(labels=labels, velocities=velocities), cost


def first_state(method: Method, network: LoadNetwork, physics: Physics) -> LearnerState:
    """Return the state before the first step."""
    devices = physics.partition.devices
    optimiser, labels = _init(method)(devices.place(network), physics)
    velocities = physics.partition.zeros(
        physics.velocity_shape if method.evaluator.warm_starts else (1,)
    )
    return LearnerState(network, devices.local(optimiser), labels, velocities)


def compile_step(method: Method, start: LearnerState, physics: Physics, batch: Batch) -> Step:
    """Compile the programs of a method's steps, for batches of this size.

    Args:
      method: its evaluator and its ``update`` are compiled.
      start: a state of the training, whose shapes and shardings all others have.
      physics: the flow solver of all samples.
      batch: indices of the samples of one batch.
    """
    partition, devices = physics.partition, physics.partition.devices
    network = devices.place(jax.tree.map(np.asarray, start.network))
    chunk = devices.place(next(partition.chunks(batch, np.zeros(physics.count, bool))))
    stored = start.velocities

    take, put = _copies(devices)
    both = physics.operators, stored
    fetch = take.lower(partition, chunk, both).compile()
    operators, velocities = fetch(partition, chunk, both)

    fetched = dataclasses.replace(physics, operators=operators)
    arguments = network, fetched, start.labels, velocities, chunk
    dimension = physics.domain.lattice.dimension
    evaluate = _evaluation(method.evaluator, devices, dimension).lower(*arguments).compile()

    put_back = put.lower(partition, chunk, stored, velocities).compile()

    labels, samples = devices.local((start.labels, physics.samples))
    arguments = start.network, start.optimiser, labels, samples, batch, np.asarray(0.0)
    update = _update(method).lower(*arguments).compile()
    return Step(physics, fetch, evaluate, put_back, update)


# The programs below are kept, so that a training like an earlier one of a process compiles none.


@functools.lru_cache(maxsize=PROGRAMS)
def _init(method: Method):
    """Return the program of a method's first state."""
    return jax.jit(method.init)


@functools.lru_cache(maxsize=PROGRAMS)
def _update(method: Method):
    """Return the program of a method's step from its labels."""
    return jax.jit(method.update)


@functools.lru_cache(maxsize=PROGRAMS)
def _copies(devices: Devices):
    """Return the programs that take a chunk's operators and velocities, and put the latter back."""

    def take_all(partition, batch, stores):
        return tuple(partition.take_local(batch, store) for store in stores)

    def take(*arguments):
        return devices.shard_map(take_all, arguments, arguments[2])(*arguments)

    def put(*arguments):
        return devices.shard_map(Partition.put_local, arguments, arguments[2])(*arguments)

    return jax.jit(take), jax.jit(put, donate_argnums=(2,))


@functools.lru_cache(maxsize=PROGRAMS)
def _evaluation(evaluator: Evaluator, devices: Devices, dimension: int):
    """Return the program of an evaluator, which methods with equal ones share."""

    def run(network, physics, labels, velocities, batch):
        arguments = network, physics, labels, velocities, batch
        mapped = devices.shard_map(evaluator.evaluate, arguments, (labels, velocities, NO_COST))
        return mapped(*arguments)

    options = same_options(dimension, gradients=True)
    return jax.jit(run, donate_argnums=(3,), compiler_options=options)
