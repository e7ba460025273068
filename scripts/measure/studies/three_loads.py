"""How many bodies buy which error of three loads: networks and rivals on the same solved flows.

Every flow is solved once, with the gradients of its loads. HIG and supervised regression, at their
best, and the rivals are fitted to the first of them; SIP at its best has the labels and the loss of
the latter (studies ``lift_methods``, ``lift_trainings`` and ``particle_methods`` have all methods).
Study ``three_loads_lift`` does the same for 2-D sections.
"""

import dataclasses
import functools
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from figures import lines
from rivals import SolvedLoads, gekpls, jenn, polynomial_with_slopes
from solved_flows import SolvedFlows, bodies_of, read_or_solve
from study import Row, Run, Study, Table, columns
from tools import medians

from surrogate import Scene
from surrogate.arrays import AnyArray
from surrogate.flow.grid.discretise import traction_modes
from surrogate.model.inputs import Inputs, scene_inputs
from surrogate.model.kriging import Observation, kriging
from surrogate.model.network import make_network
from surrogate.model.outputs import gradients_of_outputs, outputs_of
from surrogate.scene.samples import (
    Samples,
    network_key,
    shuffled_batches,
)
from surrogate.training.methods.labels import TrainingLabels
from surrogate.training.methods.method import adam
from surrogate.training.plan import make_plan

COUNTS = {"particle": (16, 32, 64, 128, 256), "lift": (64, 256, 1024, 4096)}
TRUNCATED = "hig, tau 1e-3"  # which drops more small singular values than HIG's default
# Bodies of a scene up to which a method is fitted; GEKPLS takes 33 times as long for four times as
# many sections, and JENN was tried with sections alone.
MOST = {
    ("lift", TRUNCATED): 1024,
    ("lift", "GEKPLS"): 256,
    ("particle", "hig"): 256,
    ("particle", TRUNCATED): 0,
    ("particle", "GEKPLS"): 128,
    ("particle", "JENN"): 0,
}
METHODS = (
    *("hig", TRUNCATED, "gradient-enhanced kriging", "GEKPLS", "JENN"),
    *("polynomial with gradients", "supervised"),
)
MANY = 1000  # answers whose time is taken
Outputs = Callable[[np.ndarray], np.ndarray]  # of scaled inputs (cases, inputs)


class Ground(NamedTuple):
    """The training bodies and held-out bodies of a scene, with their flows."""

    scene: Scene
    inputs: Inputs
    samples: Samples
    observations: list[Observation]
    known: SolvedLoads
    work: np.ndarray  # convolutions with G of each flow and its gradients
    seconds: float  # of a flow with its gradients
    device: str  # that solved them
    unseen: np.ndarray  # scaled inputs of the held-out bodies
    truth: np.ndarray  # their loads


def mean_and_largest(errors: AnyArray) -> Row:
    """Return the columns of a table from the errors of Cd, Cl and Cm of many bodies."""
    row = {}
    for k, load in enumerate(("cd", "cl", "cm")):
        row |= {load: errors[:, k].mean(), f"{load}_most": errors[:, k].max()}
    return row


@functools.lru_cache(maxsize=1)
def ground_of(name: str, run: Run, count: int) -> Ground:
    """Return ``count`` bodies of a scene with their flows."""
    flow, samples, unseen = bodies_of(name, run.tiny, count)
    return ground_from(flow.scene, unseen, read_or_solve(run, flow, samples, unseen))


def ground_from(scene: Scene, unseen: Samples, flows: SolvedFlows) -> Ground:
    """Return the bodies of a scene with their flows; those not found are left out.

    Args:
      scene: of all bodies.
      unseen: the held-out bodies.
      flows: of training and held-out bodies.
    """
    inputs, (samples, found, truth, seconds, device) = scene_inputs(scene), flows
    unseen = unseen.at(np.flatnonzero(truth.converged))
    kept = np.flatnonzero(found.converged)
    samples, found = jax.tree.map(lambda leaf: np.asarray(leaf)[kept], (samples, found))
    scaled = jax.vmap(inputs)
    z, steepness = scaled(*samples), jax.vmap(inputs.steepness)(samples.parameters)
    by_re = (samples.reynolds[:, None] * found.by_reynolds)[..., None]
    gradients = np.concatenate([found.gradients, by_re], axis=-1)
    steep = np.asarray(jax.vmap(gradients_of_outputs)(found.loads, gradients))
    outputs = np.asarray(jax.vmap(outputs_of)(found.loads))
    rows = zip(samples.parameters, samples.reynolds.tolist(), found.loads, steep, strict=True)
    return Ground(
        scene,
        inputs,
        samples,
        [Observation(*row) for row in rows],
        SolvedLoads(np.asarray(z), outputs, steep * np.asarray(steepness)[:, None]),
        found.green_applications,
        float(seconds),
        str(device),
        np.asarray(scaled(*unseen)),
        truth.loads[np.flatnonzero(truth.converged)],
    )


def models(scene: str, run: Run) -> Iterator[Row]:
    """Yield the cases: every method on growing numbers of bodies."""
    for bodies in run.pick((16,), COUNTS[scene]):
        methods = [name for name in METHODS if bodies <= MOST.get((scene, name), bodies)]
        yield from ({"scene": scene, "bodies": bodies, "method": name} for name in methods)


def measure(run: Run, scene: str, bodies: int, method: str) -> Row:
    """Return errors over Cd on held-out bodies, work and time of the flows, and time of the fit.

    Args:
      run: How the study is run.
      scene: Its name.
      bodies: Number of training bodies.
      method: One of ``METHODS``.
    """
    ground = ground_of(scene, run, max(COUNTS[scene]))
    begin = _clocks()
    outputs, compiling = fitted(ground, method, bodies, run.pick(2, None))
    fit_s, clock_s = _clocks() - begin - compiling
    guess = outputs(ground.unseen)
    loads = np.exp(guess[:, :1]) * np.column_stack([np.ones(len(guess)), guess[:, 1:]])
    errors = np.abs(loads - ground.truth) / ground.truth[:, :1]
    row = {"work": ground.work[:bodies].sum(), "flow_s": bodies * ground.seconds, "fit_s": fit_s}
    row |= {"all_s": row["flow_s"] + clock_s}
    row |= {"flow_device": ground.device} | mean_and_largest(errors)
    many = np.resize(ground.unseen, (MANY, ground.unseen.shape[1]))
    outputs(many)
    return row | {"answers": MANY / medians([lambda: outputs(many)], run.pick(1, 5))[0]}


def _clocks() -> np.ndarray:
    """Return the seconds of the process and of the clock."""
    return np.array([time.process_time(), time.perf_counter()])


def fitted(
    ground: Ground, method: str, count: int, iterations: int | None = None
) -> tuple[Outputs, np.ndarray]:
    """Return a predictor of the outputs fitted to the first bodies, and seconds of its compilation.

    Args:
      ground: all bodies and flows.
      method: one of ``METHODS``.
      count: number of bodies.
      iterations: of a training; by default those of its preset.
    """
    nothing = np.zeros(2)
    part = SolvedLoads(*(x[:count] for x in ground.known))
    if method == "GEKPLS":
        return gekpls(part), nothing
    if method == "JENN":
        return jenn(part, iterations), nothing
    if method == "polynomial with gradients":
        return polynomial_with_slopes(part), nothing
    if method == "gradient-enhanced kriging":
        model, compiling = kriging(ground.observations[:count], ground.inputs), nothing
    else:
        model, compiling = _trained(ground, method, count, iterations)
    answers = jax.jit(jax.vmap(model.outputs))
    return lambda z: np.asarray(answers(z)), compiling


def _trained(ground: Ground, method: str, count: int, iterations: int | None):
    """A network trained by the updates of a method on labels that are known."""
    name = "hig" if method == TRUNCATED else method
    plan = make_plan(ground.scene, name, "full", count)
    samples, known = ground.samples.head(count), ground.observations[:count]
    count = samples.count  # fewer where flows were lost
    modes = traction_modes(ground.scene).count
    tractions, outputs = -np.ones((count, modes)), ground.known.outputs[:count]
    network = make_network(ground.scene, network_key(0), *samples, tractions, outputs)
    slopes, found = np.stack([one.slopes for one in known]), np.ones(count, bool)
    labels = TrainingLabels(tractions, outputs, slopes, found, found)
    rule = plan.make_method()
    rule = dataclasses.replace(rule, tau=1e-3) if method == TRUNCATED else rule
    state = jnp.array(0) if name == "hig" else adam(rule.learning_rate).init(network.weights)
    batches, begin = shuffled_batches(plan.seed, count, rule.batch), _clocks()
    arguments = network, state, labels, samples, batches(0), np.asarray(0.0)
    step = jax.jit(rule.update).lower(*arguments).compile()
    compiling, iterations = _clocks() - begin, iterations or plan.iterations
    for k in range(iterations):
        done = np.asarray(k / iterations)
        network, state, _ = step(network, state, labels, samples, batches(k), done)
    return jax.block_until_ready(network), compiling


FORM = (
    "scene {scene} | bodies {bodies} | method {method} | error over Cd, mean and largest: "
    "Cd {cd:.3%} | {cd_most:.2%} | Cl {cl:.3%} | {cl_most:.2%} | Cm {cm:.3%} | {cm_most:.2%}"
    " | flows, G {work:,} | flows, s {flow_s:.0f} | on {flow_device} | fit, s {fit_s:.1f}"
    " | answers/s, 1,000 at a time {answers:,.0f}"
)
BY_CLOCK = FORM + " | flows and fit by the clock, s {all_s:.0f}"
BODIES, SECONDS = ("bodies", "mean error of Cd"), ("seconds of flows and fit", "mean error of Cd")
OPTIONS = {
    "--flows": {"type": Path, "help": "file of the solved flows; written if it does not exist"},
    "--device-batch": {"type": int, "help": "flows that are solved simultaneously"},
}
STUDIES = {
    "three_loads": Study(
        [Table(functools.partial(models, "particle"), measure, columns(FORM), tiny="all")],
        draw=lines("bodies", "cd", "method", BODIES),
        options=OPTIONS,
    ),
    "three_loads_lift": Study(
        [Table(functools.partial(models, "lift"), measure, columns(BY_CLOCK), tiny="all")],
        draw=lines("all_s", "cd", "method", SECONDS),
        options=OPTIONS,
    ),
}
