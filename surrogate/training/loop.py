"""One loop for every method: same samples, same weights, same held-out bodies, same clock."""

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from surrogate.errors import NotConverged
from surrogate.flow.flow import Flow
from surrogate.flow.solver.steady import preparation_cost
from surrogate.flow.steps import Labels
from surrogate.model.network import DragNetwork, make_network
from surrogate.training.checkpoint import load_checkpoint, save_checkpoint
from surrogate.training.methods.method import Method
from surrogate.training.physics import Physics, prepare_physics
from surrogate.training.plan import Plan
from surrogate.training.samples import (
    Samples,
    held_out_samples,
    network_key,
    training_samples,
)

BLOWN_UP = 10.0  # mean relative drag error of a network that is of no use any more


class Point(NamedTuple):
    """One row of a training's history; errors are relative, over the held-out bodies."""

    iteration: int
    seconds: float
    green_applications: int
    error_mean: float
    error_max: float
    loss: float
    failed: int


@dataclasses.dataclass(frozen=True)
class Trained:
    """A finished training; ``stopped`` says why it ended early, if it did."""

    network: DragNetwork
    history: tuple[Point, ...]
    stopped: str | None


class Stage(NamedTuple):
    """How far a training is: what a checkpoint holds."""

    network: DragNetwork
    state: PyTree
    iteration: Int[Array, ""]
    seconds: Float[Array, ""]
    products: Int[Array, ""]
    failed: Int[Array, ""]
    history: Float[Array, "points 7"]


class Bench(NamedTuple):
    """What all methods share: physics of the samples, held-out bodies, initial network.

    ``setup_s`` is the time the preparation of the samples took, compilation excluded.
    """

    physics: Physics
    held_out: Samples
    labels: Labels
    network: DragNetwork
    setup_s: float


def make_bench(plan: Plan) -> Bench:
    """Draw and prepare samples, solve the held-out bodies, build the initial network.

    Depends on the plan's scene, seed and counts only, not on its method.

    Raises:
      NotConverged: a held-out body flow was not found.
    """
    flow = Flow(plan.scene)
    samples = training_samples(plan.scene, plan.seed, plan.samples)
    held_out = held_out_samples(plan.scene, plan.seed, plan.held_out)
    labels = flow.labels(*held_out)
    prepare = prepare_physics.lower(flow, samples).compile()
    start = time.perf_counter()
    physics = jax.block_until_ready(prepare(samples))
    setup_s = time.perf_counter() - start
    oseen = np.asarray(physics.oseen.amplitude)
    network = make_network(plan.scene, network_key(plan.seed), *samples, oseen)
    return Bench(physics, held_out, labels, network, setup_s)


def run_training(
    plan: Plan,
    bench: Bench,
    checkpoint: Path | None = None,
    report: Callable[[Point, float], None] = lambda point, done: None,
    checkpoint_every_s: float = 20.0,
    method: Method | None = None,
) -> Trained:
    """Train the bench's network by the plan's method; resumes from ``checkpoint`` if it is there.

    ``method`` replaces the plan's own, as studies of its settings need. The checkpoint stays
    until whoever saves the result removes it.

    The clock runs from the first update (compilation excluded, listed applications of G included
    from the preparation on). ``report(point, done)`` is called at every point of the history.

    Raises:
      InvalidInput: the checkpoint is damaged or foreign.
      NotConverged: the network blew up before it had one good point.
    """
    method = method or plan.make_method()
    batches = _batches(plan, method.batch)
    prepared = bench.physics.count * preparation_cost(bench.physics.domain)
    fresh = Stage(
        bench.network,
        method.init(bench.network, bench.physics),
        *map(jnp.asarray, (0, 0.0, prepared, 0)),
        jnp.zeros((_points(plan) + 1, len(Point._fields))),
    )
    run = (checkpoint and load_checkpoint(checkpoint, plan, fresh)) or fresh
    update = jax.jit(method.update).lower(run.network, run.state, bench.physics, batches(0), 0.0)
    update = update.compile()
    clock, saved, stopped, good = _Clock(float(run.seconds)), time.perf_counter(), None, run
    while int(run.iteration) < plan.iterations:
        done = _done(plan, int(run.iteration), clock.seconds())
        if done >= 1:
            break
        network, state, spent = update(
            run.network, run.state, bench.physics, batches(int(run.iteration)), jnp.asarray(done)
        )
        run = run._replace(
            network=network,
            state=state,
            iteration=run.iteration + 1,
            products=run.products + spent.products,
            failed=run.failed + spent.failed,
        )
        if not np.all(np.isfinite(network.weights)):
            stopped, run = f"blew up in iteration {int(run.iteration)}", good
            break
        if int(run.iteration) % plan.report_every == 0 or int(run.iteration) == plan.iterations:
            run = run._replace(seconds=jnp.asarray(clock.seconds()))
            clock.pause()
            run, point = _record(run, bench, float(spent.loss))
            if not point.error_mean < BLOWN_UP:
                stopped, run = f"blew up before iteration {point.iteration}", good
                break
            good = run
            report(point, _done(plan, point.iteration, point.seconds))
            if checkpoint and time.perf_counter() - saved > checkpoint_every_s:
                save_checkpoint(checkpoint, plan, run)
                saved = time.perf_counter()
            clock.resume()
    unreported = int(run.iteration) % plan.report_every and int(run.iteration) < plan.iterations
    if stopped is None and unreported:
        run = run._replace(seconds=jnp.asarray(clock.seconds()))
        run, point = _record(run, bench, float(spent.loss))
        if not point.error_mean < BLOWN_UP:
            stopped, run = f"blew up before iteration {point.iteration}", good
    history = _history(run)
    if not history:
        raise NotConverged(f"training by {plan.method} {stopped} before its first report")
    return Trained(run.network, history, stopped)


@jax.jit
def drag_errors(
    network: DragNetwork, samples: Samples, drag: Float[Array, " samples"]
) -> Float[Array, " samples"]:
    """Relative drag error of each sample."""
    predicted = jax.vmap(network.drag)(*samples)
    return jnp.abs(predicted / drag - 1)


class _Clock:
    """Seconds of training, going on where an earlier run stopped."""

    def __init__(self, already: float):
        self._already, self._start = already, time.perf_counter()

    def seconds(self) -> float:
        return self._already + time.perf_counter() - self._start

    def pause(self) -> None:
        self._already = self.seconds()

    def resume(self) -> None:
        self._start = time.perf_counter()


def _batches(plan, size):
    """Epochs of shuffled batches, each a function of seed and iteration alone."""
    key = jax.random.fold_in(jax.random.key(plan.seed), 1)
    size = min(size, plan.samples)
    per_epoch = plan.samples // size

    def batch(iteration):
        epoch, place = divmod(iteration, per_epoch)
        order = jax.random.permutation(jax.random.fold_in(key, epoch), plan.samples)
        return order[place * size : (place + 1) * size]

    return batch


def _done(plan, iteration, seconds):
    return seconds / plan.budget_s if plan.budget_s else iteration / plan.iterations


def _points(plan):
    return min(plan.iterations // plan.report_every + 1, 2000)


def _record(run, bench, loss):
    errors = drag_errors(run.network, bench.held_out, bench.labels.drag)
    point = Point(
        int(run.iteration),
        float(run.seconds),
        int(run.products),
        float(errors.mean()),
        float(errors.max()),
        loss,
        int(run.failed),
    )
    row = min(len(_history(run)), run.history.shape[0] - 1)
    return run._replace(history=run.history.at[row].set(jnp.array(point))), point


def _history(run):
    rows = np.asarray(run.history)
    return tuple(
        Point(int(i), s, int(g), mean, worst, loss, int(failed))
        for i, s, g, mean, worst, loss, failed in rows.tolist()
        if i > 0
    )
