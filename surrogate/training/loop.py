"""The training loop, shared by all methods: same samples, initial weights and held-out bodies."""

import dataclasses
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.errors import NotConverged
from surrogate.model.network import LoadNetwork
from surrogate.processes import broadcast_from_first
from surrogate.scene.samples import shuffled_batches
from surrogate.training.checkpoint import Checkpoints
from surrogate.training.history import (
    HistoryPoint,
    blank_history,
    load_errors,
    points_of,
    with_point,
)
from surrogate.training.methods.labels import TrainingLabels
from surrogate.training.methods.method import Batch, LabelStore, Method
from surrogate.training.plan import Plan
from surrogate.training.setup import TrainingSetup
from surrogate.training.step import LearnerState, Step, compile_step, first_state

# Mean relative drag error at which a training ends. A choice, not measured: untrained networks
# have about 0.3 (study ``stability``).
BLOWN_UP = 10.0


@dataclasses.dataclass(frozen=True)
class TrainingResult:
    """The result of a training; ``stopped`` says why it ended early, None if it did not.

    ``idle_work`` counts the convolutions that devices could have done while they waited,
    ``compile_s`` the seconds of compiling the steps, ``unsolved`` the samples whose label had not
    converged at the end; 0 where the method stores no labels.
    """

    network: LoadNetwork
    history: tuple[HistoryPoint, ...]
    stopped: str | None
    idle_work: int
    compile_s: float
    unsolved: int


class TrainingState(NamedTuple):
    """The state of a training, which a checkpoint holds.

    Attributes:
      learner: network, optimiser and labels.
      reported: the network of the last report, which is the result; before the first one the
        initial network.
      evaluated: which samples the current step has evaluated so far.
      done: the fraction of the training that was done when the current step began.
      learned: whether any step had a residual to learn from.
      without_flow: the number of samples of the steps since the last one that had.
    """

    learner: LearnerState
    reported: LoadNetwork
    evaluated: Bool[AnyArray, " samples"]
    iteration: Int[AnyArray, ""]
    seconds: Float[AnyArray, ""]
    convolutions: Int[AnyArray, ""]
    failed: Int[AnyArray, ""]
    idle_work: Int[AnyArray, ""]
    done: Float[AnyArray, ""]
    learned: Bool[AnyArray, ""]
    without_flow: Int[AnyArray, ""]
    history: Float[AnyArray, "points 7"]


def run_training(
    plan: Plan,
    setup: TrainingSetup,
    checkpoint: Path | None = None,
    report: Callable[[HistoryPoint, float], None] = lambda point, done: None,
    checkpoint_every_s: float = 20.0,
    method: Method | None = None,
    evaluating: Callable[[float, LabelStore], None] = lambda done, labels: None,
) -> TrainingResult:
    """Train the initial network of a setup by the plan's method.

    The clock starts at the first step and excludes compilation; work includes assembly.

    Args:
      plan: method, iterations or time, seed.
      setup: from ``make_setup`` for this plan, or one of equal scene, seed, counts, infill and
        width.
      checkpoint: file to resume from and to save to; whoever saves the result removes it.
      report: called with every point of the history and the fraction of the training done.
      checkpoint_every_s: least seconds between checkpoints.
      method: replaces the plan's own, for studies of its settings.
      evaluating: called during a step with the fraction of the training done, and the labels.

    Returns:
      The trained network and its history; those of the last report if the network blew up, or if
      none of the flows of a whole epoch was found.

    Raises:
      InvalidInput: the checkpoint is damaged, or belongs to another plan.
      NotConverged: the network blew up before the first report, or no flow was ever found.
    """
    method = method or plan.make_method()
    physics, partition = setup.physics, setup.physics.partition
    batches = shuffled_batches(plan.seed, plan.samples, method.batch)
    checkpoints = Checkpoints(checkpoint, plan, partition, checkpoint_every_s)
    state = _first_state(plan, setup, method)
    state = checkpoints.load(state) or state
    state = state._replace(learner=state.learner.placed(partition.devices))
    start = time.perf_counter()
    step = compile_step(method, state.learner, physics, batches(0))
    compile_s = time.perf_counter() - start
    stopped = None
    while _goes_on(plan, state):
        batch = batches(int(state.iteration))
        for part in _evaluations(state, step, batch):
            state = part
            evaluating(float(state.done), state.learner.labels)
            checkpoints.save_if_due(state)
        state, loss = _updated(state, step, batch)
        done, iteration = _done(plan, state), int(state.iteration)
        if not np.all(np.isfinite(state.learner.network.weights)):
            stopped = f"blew up in iteration {iteration}"
            break
        lost = 0 if loss != 0 else int(state.without_flow) + batch.size
        learned = np.asarray(bool(state.learned) or loss != 0)
        state = state._replace(
            done=np.asarray(done), learned=learned, without_flow=np.asarray(lost)
        )
        if lost >= plan.samples:  # without any residual the network stays as it is
            stopped = f"found none of {lost} flows up to iteration {iteration}"
            break
        if iteration % plan.report_every and iteration < plan.iterations and done < 1:
            continue
        point = _point(state, setup, loss)
        if not point.error_mean < BLOWN_UP:
            stopped = f"blew up before iteration {iteration}"
            break
        reported = jax.tree.map(np.asarray, state.learner.network)
        state = state._replace(reported=reported, history=with_point(state.history, point))
        report(point, min(1.0, max(done, iteration / plan.iterations)))
        checkpoints.save_if_due(state)
    history = points_of(state.history)
    if not history:
        raise NotConverged(f"training by {plan.method} {stopped} before its first report")
    if not state.learned:
        raise NotConverged(
            f"training by {plan.method} {stopped or 'found no flow'}, and none before; lower "
            "Reynolds numbers or finer cells may help"
        )
    labels = state.learner.labels
    stored = isinstance(labels, TrainingLabels)
    unsolved = int(np.sum(~np.asarray(labels.converged))) if stored else 0
    return TrainingResult(
        state.reported, history, stopped, int(state.idle_work), compile_s, unsolved
    )


def _first_state(plan, setup, method):
    """Return the state before the first step, where the work so far is that of the assembly."""
    physics = setup.physics
    assembled = physics.count * physics.domain.assembly_cost
    return TrainingState(
        first_state(method, setup.network, physics),
        jax.tree.map(np.asarray, setup.network),
        np.zeros(physics.count, bool),
        *map(np.asarray, (0, 0.0, assembled, 0, 0, 0.0, False, 0)),
        blank_history(plan.iterations // plan.report_every + 1),
    )


def _evaluations(state: TrainingState, step: Step, batch: Batch) -> Iterator[TrainingState]:
    """Yield the state after each chunk of a step's evaluations."""
    start = time.perf_counter()
    for learner, chunk, cost in step.evaluations(state.learner, batch, state.evaluated):
        evaluated = np.array(state.evaluated)
        evaluated[chunk] = True
        costs = jax.block_until_ready(cost)
        state = state._replace(
            learner=learner,
            evaluated=evaluated,
            seconds=state.seconds + time.perf_counter() - start,
            convolutions=state.convolutions + np.asarray(costs.convolutions),
            failed=state.failed + np.asarray(costs.failed),
            idle_work=state.idle_work + np.asarray(costs.idle_work),
        )
        yield state
        start = time.perf_counter()


def _updated(state, step, batch):
    """Return the state after the update that ends a step, and the loss before it."""
    start = time.perf_counter()
    learner, loss = step.updated(state.learner, batch, float(state.done))
    loss = float(loss)  # waits for the update
    return state._replace(
        learner=learner,
        evaluated=np.zeros_like(state.evaluated),
        iteration=state.iteration + 1,
        seconds=state.seconds + time.perf_counter() - start,
    ), loss


def _done(plan, state):
    """Return the fraction of the training that is over, by time or by iterations."""
    if plan.budget_s:
        return min(float(broadcast_from_first(state.seconds / plan.budget_s)), 1.0)
    return int(state.iteration) / plan.iterations


def _goes_on(plan, state):
    """Return whether another step is made; one that a checkpoint interrupted is made to its end."""
    if int(state.iteration) >= plan.iterations:
        return False
    begun = np.any(state.evaluated) or not points_of(state.history)
    return bool(begun) or _done(plan, state) < 1


def _point(state, setup, loss):
    errors = load_errors(state.learner.network, setup.held_out, setup.labels.loads)[:, 0]
    return HistoryPoint(
        int(state.iteration),
        float(state.seconds),
        int(state.convolutions),
        float(errors.mean()),
        float(errors.max()),
        loss,
        int(state.failed),
    )
