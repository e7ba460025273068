"""What matters in a training: seeds, safeguards, settings; the half-inverse step by itself."""

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from figures import draw_maps
from studies.accuracy import adjoint_slopes
from studies.training import GRADIENTS, Truth, learned, shrunk, timed_fit
from study import Row, Run, Study, Table, cases, columns, maps, panel, words
from tools import medians, megabytes

from surrogate import Flow, NotConverged, Scene
from surrogate.devices import choose_devices
from surrogate.flow.loads import drag_coefficient
from surrogate.model.network import make_network
from surrogate.scene.samples import training_samples
from surrogate.training.loop import load_errors, run_training
from surrogate.training.methods.hig import with_goal_row
from surrogate.training.methods.method import Method, predict
from surrogate.training.methods.partial_inverse import weight_step
from surrogate.training.physics import partition_samples, prepare_physics
from surrogate.training.plan import MAKERS, Plan, make_plan
from surrogate.training.record import surrogate_of
from surrogate.training.setup import TrainingSetup, make_setup

SETUPS: dict[tuple, TrainingSetup] = {}
VARIANTS: list[tuple[str, str, dict[str, Any]]] = [
    ("hig", "as shipped", {}),
    ("hig", "no truncation (tau 0)", {"tau": 0.0}),
    ("hig", "tau 1e-3", {"tau": 1e-3}),
    ("hig", "Gauss-Newton (kappa 1)", {"kappa": 1.0, "tau": 1e-2}),
    ("hig", "half steps (eta 0.5)", {"eta": 0.5}),
    ("hig", "triple steps (eta 3)", {"eta": 3.0}),
    ("hig", "fast decay (8)", {"decay": 8.0}),
    ("hig", "small batches (16)", {"batch": 16}),
    ("dp", "as shipped", {}),
    ("dp", "no slopes", {"slopes": 0.0}),
    ("dp", "small batches (16)", {"batch": 16}),
    ("sip", "one network step per inversion", {"network_steps": 1}),
    ("sip", "no slopes", {"slopes": 0.0}),
    ("sip", "the whole traction too", {"modes": 1.0}),
    ("sip", "as shipped", {}),
]
USUAL = {  # iterations of a short training, batch, step size
    "dp": (40, 4, {"learning_rate": 1e-2}),
    "sip": (16, 8, {"learning_rate": 3e-3}),
    "hig": (12, 16, {"eta": 1.0}),
    "supervised": (16, 8, {"learning_rate": 3e-3}),
}
FACTORS, BATCHES = (0.01, 0.1, 1.0, 10.0, 100.0), (1, 4, 16, 64, 256)
SHARES = {"trained": 0.1, "slow": 0.9, "stalled": 1.1, "diverged": math.inf}  # of the first error
COLOURS = {"trained": "#4c9f70", "slow": "#b8d8a0", "stalled": "#e8c468"}
COLOURS |= {"diverged": "#e08e58", "blew up": "#c8553d"}
TAU, KAPPA, GOAL = 1e-3, 0.5, 3.0  # of the half-inverse step


def setup_of(plan: Plan) -> TrainingSetup:
    """Return samples, held-out flows and first weights, made once for trainings on equal bodies."""
    key = plan.scene, plan.samples, plan.held_out
    if key not in SETUPS:
        SETUPS[key] = make_setup(plan)
    return SETUPS[key]


def attempt(plan: Plan, method: Method) -> Row:
    """Return errors and work of a training.

    ``outcome`` is "trained" unless it fails or stops early.
    """
    try:
        trained = run_training(plan, setup_of(plan), method=method)
    except NotConverged as problem:
        return {"outcome": str(problem)}
    last, outcome = trained.history[-1], trained.stopped or "trained"
    errors = {"mean": last.error_mean, "max": last.error_max, "outcome": outcome}
    return errors | {"work": last.green_applications, "failed": last.failed}


def one_seed(run: Run, seed: int, bodies: int, method: str) -> Row:
    """Train on few bodies, and time the steps once all flows are known.

    Args:
      run: How the study is run.
      seed: Of samples and weights.
      bodies: Number of them.
      method: Of the training.
    """
    plan = dataclasses.replace(make_plan(None, method, "full", bodies, seed), report_every=20)
    plan = shrunk(plan) if run.tiny else plan
    setup = make_setup(plan)
    trained, fit = timed_fit(plan, setup)
    slopes = adjoint_slopes(Flow(plan.scene), setup.held_out.head(GRADIENTS))
    truth = Truth(setup.held_out, setup.labels, slopes)
    return {"fit_s": fit} | learned(truth, surrogate_of(plan, trained, setup))


def changed(run, method, settings, **_) -> Row:
    """Run the quick training with one setting changed, from the same weights on the same bodies.

    Args:
      run: How the study is run.
      method: Of the training.
      settings: That are changed.
      **_: The rest of the case.
    """
    plan = dataclasses.replace(make_plan(None, method, "quick"), report_every=1)
    return attempt(shrunk(plan) if run.tiny else plan, MAKERS[method](**settings))


def short_trainings(run: Run) -> list[Row]:
    """Return the cases: short trainings with one setting changed at a time."""
    taus, kappas = (1e-12, 1e-8, 1e-5, 1e-3, 1e-2, 1e-1), (-1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 1.0)
    ranges = [(10.0, 20.0), (1.0, 40.0), (0.1, 45.0)]
    hig, name = {"method": ["hig"]}, "{method}"
    every = {"method": list(USUAL)}
    return [
        *panel("truncation tau", name, "{tau:g}", cases(**hig, tau=taus)),
        *panel("exponent kappa", name, "{kappa:g}", cases(**hig, kappa=kappas)),
        *panel("step size, times", name, "{factor:g}", cases(**every, factor=FACTORS)),
        *panel("batch (of 256)", name, "{batch}", cases(**every, samples=[256], batch=BATCHES)),
        *panel("Reynolds range", name, "{re[0]:g} to {re[1]:g}", cases(**every, re=ranges)),
        *panel("weights", name, "{precision}", cases(**every, precision=("float32", "float64"))),
    ]


def _short(name: str, samples=64, re=(1.0, 40.0), factor=None, precision="", **changes):
    """A short training; small batches get more steps, up to three times as many."""
    iterations, usual, step = USUAL[name]
    steps = {key: factor * size for key, size in step.items()} if factor else {}
    changes = {"batch": usual} | steps | changes
    if name == "hig" and changes["batch"] > 64:
        changes["vectors"] = 128
    more = np.clip(usual / changes["batch"], 1.0, 3.0)
    plan = make_plan(Scene(reynolds=re, fidelity="draft"), name, "quick", samples)
    short = {"held_out": 16, "iterations": round(iterations * more), "report_every": 1}
    method = MAKERS[name](**changes)
    return dataclasses.replace(plan, **short), rounded(method) if precision == "float32" else method


def short_training(run, panel, row, column, method, **changes) -> Row:
    """Return the outcome of a short training, from the same weights as the others.

    Args:
      run: How the study is run.
      panel: Place in the maps.
      row: Place in the maps.
      column: Place in the maps.
      method: Of the training.
      **changes: Of its settings.
    """
    plan, method = _short(method, **changes)
    plan = shrunk(plan) if run.tiny else plan
    setup = setup_of(plan)
    before = float(load_errors(setup.network, setup.held_out, setup.labels.loads)[:, 0].mean())
    found = attempt(plan, method)
    outcome = "blew up"
    if found["outcome"] == "trained":
        share = found["mean"] / before
        outcome = next(name for name, most in SHARES.items() if share < most)
    return found | {"before": before, "outcome": outcome}


def rounded(method: Method) -> Method:
    """Return the method with weights that are rounded to single precision after every step."""

    class Rounded(type(method)):
        def update(self, *arguments):
            network, optimiser, loss = super().update(*arguments)
            weights = network.weights.astype(jnp.float32).astype(float)
            return network.with_weights(weights), optimiser, loss

    return Rounded(**vars(method))


def draw(result, path):
    """Draw maps of the outcomes."""
    draw_maps(result["fields"], lambda row: words("{mean:.1%}", **row), COLOURS, path, abreast=3)


def half_inverse(run: Run, size: float) -> list[Row]:
    """Compare half-inverse steps, dense and matrix-free by Lanczos vectors, of a new network.

    The matrix is the chain dy/da da/dw of an untrained network.
    """
    flow = Flow(Scene(fidelity=run.fidelity("draft")))
    samples = training_samples(flow.scene, 0, run.pick(4, 16))
    physics = prepare_physics(
        flow, samples, partition_samples(flow.scene.family, samples, choose_devices())
    )
    oseen, key = np.asarray(physics.tractions), jax.random.key(1)
    width = round(np.sqrt(size + 121) - 11)
    network = make_network(flow.scene, key, *physics.samples, oseen, physics.outputs, width)
    batch, matrix = jnp.arange(physics.count), physics.influence
    slip = jnp.einsum("bym,bm->by", matrix, predict(network, physics.samples, batch) - oseen)
    y, physical = with_goal_row(slip, matrix, GOAL, drag_coefficient(oseen))
    rows, dense = [], None
    for vectors in (None, *run.pick((8,), (16, 64, 256))):

        def step(network, y, physical, vectors=vectors):
            def outcomes(weights, k):
                sample = jax.tree.map(lambda part: part[k], physics.samples)
                return physical[k] @ network.with_weights(weights).traction(*sample)

            return weight_step(outcomes, network.weights, batch, y, TAU, KAPPA, vectors)

        compiled = jax.jit(step).lower(network, y, physical).compile()
        found = compiled(network, y, physical)
        dense = found if vectors is None else dense
        seconds = medians([lambda call=compiled: call(network, y, physical)], 3)[0]
        name = f"{vectors} Lanczos vectors" if vectors else "dense"
        row = {"weights": network.weights.size, "rows": y.size, "inverse": name}
        row |= {"mib": megabytes(compiled) * 1e6 / 2**20, "seconds": seconds}
        rows.append(row | {"difference": jnp.linalg.norm(found - dense) / jnp.linalg.norm(dense)})
    return rows


SEED = columns(
    "method {method} | bodies {bodies} | seed {seed} | mean error {error_mean:.3%}"
    " | largest {error_max:.2%} | gradient {gradient:.1%} | G {green_applications}"
    " | CPU seconds of the fit {fit_s:.1f}"
)
SEEDS = cases(seed=(0, 1, 2), bodies=(64, 256), method=("hig", "sip"))
VARIANT = columns(
    "method {method} | variant {variant} | mean error {mean:.2%} | largest {max:.2%}"
    " | G {work} | samples left out {failed} | outcome {outcome}"
)
CHANGES = [dict(zip(("method", "variant", "settings"), one, strict=True)) for one in VARIANTS]
SHORT = maps(lambda row: words("{mean:.2%}, {outcome}", **row))
STEP = columns(
    "weights {weights} | rows {rows} | inverse {inverse} | time {seconds:.3f} s"
    " | memory {mib:.1f} MiB | difference from dense {difference:.1e}"
)
STUDIES = {
    "seeds": Study([Table(SEEDS, one_seed, SEED)]),
    "safeguards": Study([Table(CHANGES, changed, VARIANT, tiny="last")]),
    "stability": Study(
        [Table(short_trainings, short_training, SHORT, "fields", "last")], draw=draw
    ),
    "hig": Study([Table(cases(size=(1e3, 1e4, 1e5, 1e6)), half_inverse, STEP)]),
}
