"""How many bodies buy which error of three loads: networks and rivals on the same solved flows.

Every flow is solved once, with the gradients of its loads. HIG and supervised regression, at their
best, and the rivals are fitted to the first of them; SIP at its best has the labels and the loss of
the latter, at about the same cost.
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
from rivals import SolvedLoads, gekpls, polynomial_with_slopes
from study import TINY, Row, Run, Study, Table, columns
from tools import medians

from surrogate import Flow, Scene
from surrogate.flow.grid.discretise import traction_modes
from surrogate.model.inputs import Inputs, scene_inputs
from surrogate.model.kriging import Observation, kriging
from surrogate.model.network import make_network
from surrogate.model.outputs import output_gradients, outputs_of
from surrogate.scene.samples import Samples, held_out_samples, network_key, training_samples
from surrogate.training.methods.labels import TrainingLabels
from surrogate.training.methods.method import adam
from surrogate.training.plan import make_plan

SCRIPTS = Path(__file__).parents[2]
COUNTS = {"particle": (16, 32, 64), "lift": (32, 64, 128, 256)}
HELD_OUT = 48
CELLS = {"particle": 10}  # per D in place of the scene's: a fifth of the time
METHODS = ("hig", "supervised", "gradient-enhanced kriging", "GEKPLS", "polynomial with gradients")
MANY = 1000  # answers whose time is taken
Outputs = Callable[[np.ndarray], np.ndarray]  # of scaled inputs (cases, inputs)


class Ground(NamedTuple):
    """Training bodies and held-out bodies of a scene, with their flows."""

    scene: Scene
    inputs: Inputs
    samples: Samples
    observations: list[Observation]
    known: SolvedLoads
    work: np.ndarray  # convolutions with G of each flow and its gradients
    seconds: float  # of processor time, a flow with its gradients
    unseen: np.ndarray  # scaled inputs of the held-out bodies
    truth: np.ndarray  # their loads


@functools.lru_cache(maxsize=1)
def ground_of(name: str, tiny: bool) -> Ground:
    """Solve the flows; those that are not found are left out."""
    scene = Scene.read(SCRIPTS / f"{name}.toml")
    level = TINY if tiny else scene.fidelity
    if name in CELLS and not tiny:
        level = dataclasses.replace(level, cells=CELLS[name])
    scene = dataclasses.replace(scene, fidelity=level)
    flow, inputs = Flow(scene), scene_inputs(scene)
    unseen = held_out_samples(scene, 0, 4 if tiny else HELD_OUT)
    truth = flow.solve_all(*unseen)
    unseen = unseen.at(np.flatnonzero(truth.converged))
    samples = training_samples(scene, 0, 16 if tiny else max(COUNTS[name]))
    ends, slopes = [], []
    for one in zip(*map(np.asarray, samples), strict=True):
        slopes.append(jax.block_until_ready(flow.slope(*one)))
        ends.append(time.process_time())
    seconds = (ends[-1] - ends[0]) / (len(ends) - 1)  # without the first, which compiles
    found = jax.tree.map(lambda *leaves: np.stack(leaves), *slopes)
    kept = np.flatnonzero(found.converged)
    samples, found = jax.tree.map(lambda leaf: np.asarray(leaf)[kept], (samples, found))
    scaled = jax.vmap(inputs)
    z, steepness = scaled(*samples), jax.vmap(inputs.steepness)(samples.parameters)
    by_re = (samples.reynolds[:, None] * found.by_reynolds)[..., None]
    gradients = np.concatenate([found.gradients, by_re], axis=-1)
    steep = np.asarray(jax.vmap(output_gradients)(found.loads, gradients))
    outputs = np.asarray(jax.vmap(outputs_of)(found.loads))
    rows = zip(samples.parameters, samples.reynolds.tolist(), found.loads, steep, strict=True)
    return Ground(
        scene,
        inputs,
        samples,
        [Observation(*row) for row in rows],
        SolvedLoads(np.asarray(z), outputs, steep * np.asarray(steepness)[:, None]),
        found.green_applications,
        seconds,
        np.asarray(scaled(*unseen)),
        truth.loads[np.flatnonzero(truth.converged)],
    )


def models(run: Run) -> Iterator[Row]:
    """Every method on growing numbers of bodies."""
    for scene in run.pick(("lift",), run.options["scenes"].split(",")):
        for bodies in run.pick((16,), COUNTS.get(scene, ())):
            yield from ({"scene": scene, "bodies": bodies, "method": name} for name in METHODS)


def measure(run: Run, scene: str, bodies: int, method: str) -> Row:
    """Errors over Cd on held-out bodies, the work and time of the flows, the time of the fit."""
    ground = ground_of(scene, run.tiny)
    begin = time.process_time()
    outputs, compile_s = _fitted(ground, method, bodies, run)
    fit_s = time.process_time() - begin - compile_s
    guess = outputs(ground.unseen)
    loads = np.exp(guess[:, :1]) * np.column_stack([np.ones(len(guess)), guess[:, 1:]])
    errors = np.abs(loads - ground.truth) / ground.truth[:, :1]
    row = {"work": ground.work[:bodies].sum(), "flow_s": bodies * ground.seconds, "fit_s": fit_s}
    for k, load in enumerate(("cd", "cl", "cm")):
        row |= {load: errors[:, k].mean(), f"{load}_most": errors[:, k].max()}
    many = np.resize(ground.unseen, (MANY, ground.unseen.shape[1]))
    outputs(many)
    return row | {"answers": MANY / medians([lambda: outputs(many)], run.pick(1, 5))[0]}


def _fitted(ground: Ground, method: str, count: int, run: Run) -> tuple[Outputs, float]:
    """Outputs at scaled inputs by a method from the first bodies, and its compilation's seconds."""
    part = SolvedLoads(*(x[:count] for x in ground.known))
    if method == "GEKPLS":
        return gekpls(part), 0.0
    if method == "polynomial with gradients":
        return polynomial_with_slopes(part), 0.0
    if method == "gradient-enhanced kriging":
        model, compile_s = kriging(ground.observations[:count], ground.inputs), 0.0
    else:
        model, compile_s = _trained(ground, method, count, run)
    answers = jax.jit(jax.vmap(model.outputs))
    return lambda z: np.asarray(answers(z)), compile_s


def _trained(ground: Ground, method: str, count: int, run: Run):
    """A network trained by the updates of a method on labels that are known."""
    plan = make_plan(ground.scene, method, "full", count)
    samples, known = ground.samples.head(count), ground.observations[:count]
    modes = traction_modes(ground.scene.family, ground.scene.fidelity).count
    tractions, outputs = -np.ones((count, modes)), ground.known.outputs[:count]
    network = make_network(ground.scene, network_key(0), *samples, tractions, outputs)
    slopes, found = np.stack([one.slopes for one in known]), np.ones(count, bool)
    labels = TrainingLabels(tractions, outputs, slopes, found, found)
    rule = plan.make_method()
    state = jnp.array(0) if method == "hig" else adam(rule.learning_rate).init(network.weights)
    begin = time.process_time()
    arguments = network, state, labels, samples, jnp.arange(count), np.asarray(0.0)
    step = jax.jit(rule.update).lower(*arguments).compile()
    compile_s, iterations = time.process_time() - begin, run.pick(2, plan.iterations)
    for k in range(iterations):
        done = np.asarray(k / iterations)
        network, state, _ = step(network, state, *arguments[2:5], done)
    return network, compile_s


COLUMNS = columns(
    "scene {scene} | bodies {bodies} | method {method} | error over Cd, mean and largest: "
    "Cd {cd:.3%} | {cd_most:.2%} | Cl {cl:.3%} | {cl_most:.2%} | Cm {cm:.3%} | {cm_most:.2%}"
    " | flows, G {work:,} | flows, s {flow_s:.0f} | fit, s {fit_s:.1f}"
    " | answers/s, 1,000 at a time {answers:,.0f}"
)
DRAW = lines("bodies", "cd", "method", ("bodies", "mean error of Cd"), "scene")
OPTIONS = {"--scenes": {"default": "particle,lift", "help": "of particle, lift (both)"}}
STUDIES = {
    "three_loads": Study([Table(models, measure, COLUMNS, tiny="all")], draw=DRAW, options=OPTIONS)
}
