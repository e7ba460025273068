"""A step of a training: owners visit the bodies of a batch, one device learns what they told.

Each is a compiled program of its own. Rows of a batch are fetched for a visit and returned after
it, portion by portion, so that no program moves or holds the fields of all bodies; once all have
told what they can, steps are the network's alone, and bodies and other devices rest.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from surrogate.devices import Deal, Devices, Owned
from surrogate.model.network import DragNetwork
from surrogate.training.methods.method import Batch, Lessons, Method, Spent
from surrogate.training.physics import Physics

RESTED = Spent(0, 0, 0)


class Learning(NamedTuple):
    """What a training changes: network and the method's memory, lessons, every body's last flow."""

    network: DragNetwork
    memory: PyTree
    lessons: Lessons
    flows: Owned

    def placed(self, devices: Devices) -> "Learning":
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
        self, now: Learning, batch: Batch, done: float
    ) -> tuple[Learning, Spent, jax.Array]:
        """The next state, what visits took, and the loss before."""
        deal, spent = self.physics.deal, RESTED
        if now.lessons.asks(batch):
            network = deal.devices.share(jax.tree.map(np.asarray, now.network))
            for portion in deal.portions(batch):
                now, more = self._visited(now, deal.devices.share(portion), network)
                spent = jax.tree.map(lambda a, b: a + int(b), spent, more)
        lessons, samples = deal.devices.local((now.lessons, self.physics.samples))
        network, memory, loss = self.learn(
            now.network, now.memory, lessons, samples, batch, np.asarray(done)
        )
        return now._replace(network=network, memory=memory), spent, loss

    def _visited(self, now, batch, network):
        deal, cases = self.physics.deal, self.physics.cases
        cases, flows = self.fetch(deal, batch, (cases, now.flows))
        here = dataclasses.replace(self.physics, cases=cases)
        lessons, flows, spent = self.visit(network, here, now.lessons, flows, batch)
        flows = self.give_back(deal, batch, now.flows, flows)
        return now._replace(lessons=lessons, flows=flows), spent


def first_state(method: Method, network: DragNetwork, physics: Physics, oseen: Owned) -> Learning:
    """Before the first step."""
    devices = physics.deal.devices
    memory, lessons = jax.jit(method.init)(devices.share(network), physics)
    flows = jax.tree.map(jnp.copy, oseen)  # a training overwrites them
    return Learning(network, devices.local(memory), lessons, flows)


def compile_step(method: Method, start: Learning, physics: Physics, batch: Batch) -> Step:
    """The programs of a method's steps, for batches of this size."""
    deal, devices, done = physics.deal, physics.deal.devices, np.asarray(0.0)
    portion, network = next(deal.portions(batch)), jax.tree.map(np.asarray, start.network)
    portion, network = devices.share((portion, network))

    def compiled(function, like, answers, donated=()):
        spread = devices.spread(function, like, answers)
        return jax.jit(spread, donate_argnums=donated).lower(*like)

    def fetch(deal, batch, stores):
        return tuple(deal.fetched(batch, store) for store in stores)

    stores = physics.cases, start.flows
    fetch = compiled(fetch, (deal, portion, stores), stores).compile()
    cases, flows = fetch(deal, portion, stores)
    like = network, dataclasses.replace(physics, cases=cases), start.lessons, flows, portion
    visit = compiled(method.visit, like, (start.lessons, flows, RESTED), donated=(3,))
    like = deal, portion, start.flows, flows
    give_back = compiled(Deal.returned, like, start.flows, donated=(2,)).compile()
    lessons, samples = devices.local((start.lessons, physics.samples))
    like = start.network, start.memory, lessons, samples, batch, done
    learn = jax.jit(method.learn).lower(*like).compile()
    return Step(physics, fetch, visit.compile(devices.options), give_back, learn)
