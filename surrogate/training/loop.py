"""One loop for every method: same samples, same weights, same held-out bodies, same clock."""

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from surrogate.arrays import AnyArray
from surrogate.devices import Devices, Sharded, choose_devices
from surrogate.errors import NotConverged
from surrogate.flow.batch import FlowBatch
from surrogate.flow.flow import Flow
from surrogate.model.network import DragNetwork, make_network
from surrogate.processes import agreed
from surrogate.training.checkpoint import load_checkpoint, save_checkpoint
from surrogate.training.methods.method import Method
from surrogate.training.physics import Physics, partition_samples, prepare_physics
from surrogate.training.plan import Plan
from surrogate.training.samples import (
    Samples,
    held_out_samples,
    network_key,
    training_samples,
)
from surrogate.training.step import LearnerState, compile_step, first_state

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
class TrainingResult:
    """A finished training; ``stopped`` says why it ended early, if it did.

    ``idle_work`` are applications of G that idle devices and lanes could have done, ``compile_s``
    what compiling the steps took.
    """

    network: DragNetwork
    history: tuple[Point, ...]
    stopped: str | None
    idle_work: int
    compile_s: float


class Stage(NamedTuple):
    """How far a training is: what a checkpoint holds."""

    now: LearnerState
    iteration: Int[AnyArray, ""]
    seconds: Float[AnyArray, ""]
    products: Int[AnyArray, ""]
    failed: Int[AnyArray, ""]
    idle_work: Int[AnyArray, ""]
    history: Float[AnyArray, "points 7"]


class TrainingSetup(NamedTuple):
    """What all methods share: samples and their Oseen flows, held-out bodies, initial network.

    ``setup_s`` is the time the preparation of the samples took, ``compile_s`` that of compiling it.
    """

    physics: Physics
    oseen: Sharded
    held_out: Samples
    labels: FlowBatch
    network: DragNetwork
    setup_s: float
    compile_s: float


def make_setup(plan: Plan, devices: Devices | None = None) -> TrainingSetup:
    """Draw and prepare samples, solve the held-out bodies, build the initial network.

    Depends on the plan's scene, seed and counts only, not on its method.

    Raises:
      NotConverged: a held-out body flow was not found.
    """
    flow = Flow(plan.scene)
    samples = training_samples(plan.scene, plan.seed, plan.samples)
    held_out = held_out_samples(plan.scene, plan.seed, plan.held_out)
    devices = devices or choose_devices()
    labels = flow.labels(*held_out, devices)
    samples, partition = devices.share(
        (samples, partition_samples(plan.scene.family, samples, devices))
    )
    start = time.perf_counter()
    prepare = prepare_physics.lower(flow, samples, partition).compile(devices.options)
    compiled = time.perf_counter()
    physics, velocities = jax.block_until_ready(prepare(samples, partition))
    seconds = time.perf_counter() - compiled, compiled - start
    oseen = np.asarray(physics.tractions)
    network = make_network(plan.scene, network_key(plan.seed), *map(np.asarray, samples), oseen)
    return TrainingSetup(physics, velocities, held_out, labels, network, *seconds)


def run_training(
    plan: Plan,
    bench: TrainingSetup,
    checkpoint: Path | None = None,
    report: Callable[[Point, float], None] = lambda point, done: None,
    checkpoint_every_s: float = 20.0,
    method: Method | None = None,
) -> TrainingResult:
    """Train the bench's network by the plan's method; resumes from ``checkpoint`` if it is there.

    ``method`` replaces the plan's own, as studies of its settings need. The checkpoint stays
    until whoever saves the result removes it.

    The clock runs from the first step (compilation excluded, listed applications of G included
    from the preparation on). ``report(point, done)`` is called at every point of the history.

    Raises:
      InvalidInput: the checkpoint is damaged or foreign.
      NotConverged: the network blew up before it had one good point.
    """
    method = method or plan.make_method()
    physics, partition = bench.physics, bench.physics.partition
    batches = _batches(plan, method.batch)
    prepared = physics.count * physics.domain.assembly_cost
    fresh = Stage(
        first_state(method, bench.network, physics, bench.oseen),
        *map(np.asarray, (0, 0.0, prepared, 0, 0)),
        np.zeros((_points(plan) + 1, len(Point._fields))),
    )
    run = (checkpoint and load_checkpoint(checkpoint, plan, fresh, partition)) or fresh
    run = run._replace(now=run.now.placed(partition.devices))
    start = time.perf_counter()
    step = compile_step(method, run.now, physics, batches(0))
    compile_s = time.perf_counter() - start
    clock, saved, stopped, good = _Clock(float(run.seconds)), time.perf_counter(), None, run
    while int(run.iteration) < plan.iterations:
        done = _done(plan, int(run.iteration), clock)
        if done >= 1:
            break
        now, spent, loss = step(run.now, batches(int(run.iteration)), done)
        run = run._replace(
            now=now,
            iteration=run.iteration + 1,
            products=run.products + np.asarray(spent.products),
            failed=run.failed + np.asarray(spent.failed),
            idle_work=run.idle_work + np.asarray(spent.idle_work),
        )
        if not np.all(np.isfinite(now.network.weights)):
            stopped, run = f"blew up in iteration {int(run.iteration)}", good
            break
        if int(run.iteration) % plan.report_every == 0 or int(run.iteration) == plan.iterations:
            run = run._replace(seconds=np.asarray(clock.seconds()))
            clock.pause()
            run, point = _record(run, bench, float(loss))
            if not point.error_mean < BLOWN_UP:
                stopped, run = f"blew up before iteration {point.iteration}", good
                break
            good = run
            report(point, max(done, point.iteration / plan.iterations))
            if checkpoint and agreed(time.perf_counter() - saved > checkpoint_every_s):
                save_checkpoint(checkpoint, plan, run, partition)
                saved = time.perf_counter()
            clock.resume()
    unreported = int(run.iteration) % plan.report_every and int(run.iteration) < plan.iterations
    if stopped is None and unreported:
        run = run._replace(seconds=np.asarray(clock.seconds()))
        run, point = _record(run, bench, float(loss))
        if not point.error_mean < BLOWN_UP:
            stopped, run = f"blew up before iteration {point.iteration}", good
    history = _history(run)
    if not history:
        raise NotConverged(f"training by {plan.method} {stopped} before its first report")
    network = jax.tree.map(np.asarray, run.now.network)
    return TrainingResult(network, history, stopped, int(run.idle_work), compile_s)


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
        return np.asarray(order)[place * size : (place + 1) * size]

    return batch


def _done(plan, iteration, clock):
    if plan.budget_s:
        return float(agreed(clock.seconds() / plan.budget_s))
    return iteration / plan.iterations


def _points(plan):
    return min(plan.iterations // plan.report_every + 1, 2000)


def _record(run, bench, loss):
    errors = drag_errors(run.now.network, bench.held_out, bench.labels.drag)
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
    history = np.array(run.history)
    history[row] = point
    return run._replace(history=history), point


def _history(run):
    return tuple(
        Point(int(i), s, int(g), mean, worst, loss, int(failed))
        for i, s, g, mean, worst, loss, failed in run.history.tolist()
        if i > 0
    )
