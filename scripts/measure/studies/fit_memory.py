"""Peak memory of fitting surrogates of Cd, Cl and Cm, each fit in a process of its own.

Bodies are those of studies ``three_loads`` and ``three_loads_lift``; their loads and gradients are
those of the shipped networks, on which the memory does not depend but for the polynomial's degree.
DP and SIP solve their flows themselves, as these are part of every step or of its labels.
"""

import contextlib
import dataclasses
import functools
import importlib
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor

import jax
import numpy as np
from solved_flows import SolvedFlows, scene_of
from studies.three_loads import COUNTS, Ground, fitted, ground_from, models
from study import Result, Row, Run, Study, Table, maps
from tools import PeakMemory, cold_cache

from surrogate import load
from surrogate.flow.batch import FlowBatch
from surrogate.flow.derivatives import LoadsAndGradients
from surrogate.scene.samples import training_samples
from surrogate.training.loop import run_training
from surrogate.training.plan import make_plan
from surrogate.training.setup import make_setup

SCENE = "lift"  # of the sentence in the README
PACKAGES = ("sklearn.preprocessing", "smt.surrogate_models")  # imported before every fit
STEPS = 2  # of a training, every one of which takes as much memory
WITH_FLOWS = "dp", "sip"  # methods that solve flows while they train
SOLVED = {"lift": (64, 256, 1024, 4096)}  # bodies of these
HELD_OUT = 4  # bodies of these trainings


def fits(run: Run) -> Iterator[Row]:
    """Yield the cases: every method on growing numbers of bodies of both scenes."""
    for scene in COUNTS:
        yield from models(scene, run)
        for bodies in run.pick((), SOLVED.get(scene, ())):
            yield from ({"scene": scene, "bodies": bodies, "method": name} for name in WITH_FLOWS)


def measure(run: Run, scene: str, bodies: int, method: str) -> Row:
    """Return by how much a process grows, at most, while it fits a method, compilation included.

    Args:
      run: How the study is run.
      scene: Its name.
      bodies: Number of training bodies.
      method: One of ``three_loads.METHODS`` or of those with flows.

    Raises:
      BrokenProcessPool: The system ended the process, for its memory perhaps.
    """
    task: tuple = train_with_flows, scene, method, bodies
    if method not in WITH_FLOWS:
        task = fitted, ground_by_network(scene, bodies), method, bodies, STEPS
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return {"mib": pool.submit(growth, *task).result()}


def growth(fit: Callable[..., object], *arguments: object) -> float:
    """Return the greatest growth of this process, in MiB, during ``fit(*arguments)``."""
    for package in PACKAGES:
        with contextlib.suppress(ImportError):
            importlib.import_module(package)
    jax.device_put(1.0)  # starts JAX
    with cold_cache(), PeakMemory() as memory:
        fit(*arguments)
    return memory.mib


def train_with_flows(scene: str, method: str, count: int) -> None:
    """Make the first steps of a training that solves the flows of its bodies."""
    plan = make_plan(scene_of(scene, False), method, "full", count, held_out=HELD_OUT)
    steps = dataclasses.replace(plan, iterations=STEPS)
    run_training(steps, make_setup(steps), method=plan.make_method())


@functools.lru_cache(maxsize=1)
def ground_by_network(name: str, count: int) -> Ground:
    """Return bodies of a scene with the loads and gradients of its shipped network."""
    net = load(f"pretrained:{name}")
    samples = training_samples(net.scene, 0, count)

    @jax.jit
    @jax.vmap
    def loads_and_gradients(parameters, reynolds):
        by = jax.jacrev(net.loads, argnums=(0, 1))(parameters, reynolds)
        return net.loads(parameters, reynolds), *by

    found = map(np.asarray, loads_and_gradients(*samples))
    nothing, all_found = np.zeros(count, int), np.ones(count, bool)
    flows = LoadsAndGradients(*found, nothing, all_found)
    held_out = FlowBatch(np.zeros((count, 1)), flows.loads, nothing, all_found)
    device = np.array("network")
    return ground_from(
        net.scene, samples, SolvedFlows(samples, flows, held_out, np.zeros(()), device)
    )


def in_short(result: Result, errors: Result) -> str:
    """Return the README's sentence on fits to the most sections that kriging can hold.

    Args:
      result: of this study.
      errors: of study ``three_loads_lift``.
    """
    kriging, network = "gradient-enhanced kriging", "hig"
    most = max(row["bodies"] for row in errors["rows"] if row["method"] == kriging)
    found = []
    for method in (kriging, network):
        at, row = {"scene": SCENE, "bodies": most, "method": method}, {}
        for rows in (errors["rows"], result["rows"]):
            row |= next(each for each in rows if at.items() <= each.items())
        off = "/".join(f"{100 * row[load]:.2f}" for load in ("cd", "cl", "cm"))
        found.append((off, row["answers"], row["mib"]))
    (off, answers, mib), (own, many, own_mib) = found
    return (
        f"Fitted to {most:,} sections, kriging with gradients errs by {off} % (Cd/Cl/Cm) of Cd "
        f"({answers:,.0f} answers/s, {mib:,.0f} MiB to fit), `{network}` by {own} % ({many:,.0f}, "
        f"{own_mib:,.0f})."
    )


def text(rows: Sequence[Row]) -> str:
    """Return one table a scene, of methods over bodies."""
    placed = [
        row | {"panel": row["scene"], "row": row["method"], "column": f"{row['bodies']:,} bodies"}
        for row in rows
    ]
    return maps(lambda row: f"{row['mib']:,.0f} MiB")(placed)


STUDIES = {"fit_memory": Study([Table(fits, measure, text)])}
