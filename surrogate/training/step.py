"""A step of a training: owners visit the bodies of a batch, one device learns what they told.

Each is a compiled program of its own. Rows of a batch are fetched for a visit and returned after
it, chunk by chunk, so that no program moves or holds the fields of all bodies; once all have
told what they can, steps are the network's alone, and bodies and other devices rest.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from surrogate.devices import Devices, Partition, Sharded
from surrogate.model.network import DragNetwork
from surrogate.training.methods.method import Batch, EvaluationCost, LabelStore, Method
from surrogate.training.physics import Physics

RESTED = EvaluationCost(0, 0, 0)


class LearnerState(NamedTuple):
    """What a training changes: network and the method's memory, lessons, every body's last flow."""

    network: DragNetwork
    memory: PyTree
    lessons: LabelStore
    flows: Sharded

    def placed(self, devices: Devices) -> "LearnerState":
        """The same with lessons on every device, and flows on those that own them."""
        lessons, flows = devices.share((self.lessons, self.flows))
        return self._replace(lessons=lessons, flows=flows)


class Step(NamedTuple):
    """A step's programs, and the physics that they visit."""

    physics: Physics
    fetch: Callable
    visit: Callable
    give_back: Callable
    learn: Callable

    def __call__(
        self, now: LearnerState, batch: Batch, done: float
    ) -> tuple[LearnerState, EvaluationCost, jax.Array]:
        """The next state, what visits took, and the loss before."""
        partition, spent = self.physics.partition, RESTED
        if now.lessons.asks(batch):
            network = partition.devices.share(jax.tree.map(np.asarray, now.network))
            for chunk in partition.chunks(batch):
                now, more = self._visited(now, partition.devices.share(chunk), network)
                spent = jax.tree.map(lambda a, b: a + int(b), spent, more)
        lessons, samples = partition.devices.local((now.lessons, self.physics.samples))
        network, memory, loss = self.learn(
            now.network, now.memory, lessons, samples, batch, np.asarray(done)
        )
        return now._replace(network=network, memory=memory), spent, loss

    def _visited(self, now, batch, network):
        partition, operators = self.physics.partition, self.physics.operators
        operators, flows = self.fetch(partition, batch, (operators, now.flows))
        here = dataclasses.replace(self.physics, operators=operators)
        lessons, flows, spent = self.visit(network, here, now.lessons, flows, batch)
        flows = self.give_back(partition, batch, now.flows, flows)
        return now._replace(lessons=lessons, flows=flows), spent


def first_state(
    method: Method, network: DragNetwork, physics: Physics, oseen: Sharded
) -> LearnerState:
    """Before the first step."""
    devices = physics.partition.devices
    memory, lessons = jax.jit(method.init)(devices.share(network), physics)
    flows = jax.tree.map(jnp.copy, oseen)  # a training overwrites them
    return LearnerState(network, devices.local(memory), lessons, flows)


def compile_step(method: Method, start: LearnerState, physics: Physics, batch: Batch) -> Step:
    """The programs of a method's steps, for batches of this size."""
    partition, devices, done = physics.partition, physics.partition.devices, np.asarray(0.0)
    chunk, network = next(partition.chunks(batch)), jax.tree.map(np.asarray, start.network)
    chunk, network = devices.share((chunk, network))

    def compiled(function, like, answers, donated=()):
        spread = devices.spread(function, like, answers)
        return jax.jit(spread, donate_argnums=donated).lower(*like)

    def fetch(partition, batch, stores):
        return tuple(partition.take_local(batch, store) for store in stores)

    stores = physics.operators, start.flows
    fetch = compiled(fetch, (partition, chunk, stores), stores).compile()
    operators, flows = fetch(partition, chunk, stores)
    like = network, dataclasses.replace(physics, operators=operators), start.lessons, flows, chunk
    visit = compiled(method.visit, like, (start.lessons, flows, RESTED), donated=(3,))
    like = partition, chunk, start.flows, flows
    give_back = compiled(Partition.put_local, like, start.flows, donated=(2,)).compile()
    lessons, samples = devices.local((start.lessons, physics.samples))
    like = start.network, start.memory, lessons, samples, batch, done
    learn = jax.jit(method.learn).lower(*like).compile()
    return Step(physics, fetch, visit.compile(devices.options), give_back, learn)
