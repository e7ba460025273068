"""A surrogate trained on where its optima and the flow disagree."""

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from surrogate.arrays import AnyArray
from surrogate.body import PARAMETERS, opening
from surrogate.errors import InvalidInput
from surrogate.scene import Scene
from surrogate.store import Surrogate, read_scene
from surrogate.training.loop import Bench, make_bench
from surrogate.training.physics import Samples, prepare_physics
from surrogate.training.presets import Plan

DEVIATION = 0.05  # of the new samples around an optimum, over the width of every range
BATCH = 8  # of supervised training
PASSES = 12  # over all samples: the first solves their flows


class Gap(NamedTuple):
    """A verified body, its Cd by the flow, and how far the surrogate is off, relatively."""

    parameters: AnyArray
    reynolds: float
    cd: float
    error: float


def gaps(surrogate: Surrogate, records: list[dict[str, Any]]) -> list[Gap]:
    """Surrogate against flow at every case of the runs.

    Raises:
      InvalidInput: a run is of another scene.
    """
    found = []
    for record in records:
        if read_scene(record["scene"]) != surrogate.scene:
            raise InvalidInput("refinement: a run is of another scene than the surrogate's")
        for parameters, reynolds, cd in _cases(record):
            predicted = float(surrogate.drag(jnp.asarray(parameters), reynolds))
            found.append(Gap(parameters, reynolds, cd, abs(predicted / cd - 1)))
    return found


def samples_around(scene: Scene, gaps: list[Gap], count: int, key: jax.Array) -> Samples:
    """Every body itself and ``count`` normal draws around it, cut to the trained ranges."""
    bounds = np.concatenate([scene.family.bounds, np.log([scene.reynolds])])
    low, high = bounds.T
    centres = np.array([[*gap.parameters, np.log(gap.reynolds)] for gap in gaps])
    normal = jax.random.normal(key, (len(gaps), count, len(low)), float)
    around = centres[:, None] + DEVIATION * (high - low) * np.asarray(normal)
    around = np.clip(around.reshape(-1, len(low)), low, high)
    closed = np.asarray(jax.vmap(lambda row: opening(row[:-1]))(jnp.asarray(around))) > 0.04
    rows = np.concatenate([centres, around[closed]])
    return Samples(rows[:, :-1], np.exp(rows[:, -1]))


def widened(surrogate: Surrogate, added: Samples) -> tuple[Plan, Bench]:
    """Plan and bench of a supervised training that goes on from the surrogate's weights.

    The samples of its first training are drawn again from its seed, so that it does not forget,
    and those of earlier refinements are read from its record.

    Raises:
      InvalidInput: the surrogate's record does not say how it was trained.
      NotConverged: a held-out flow was not found.
    """
    samples, held_out, seed = map(surrogate.recorded, ("samples", "held_out", "seed"))
    first = Plan("supervised", surrogate.scene, samples, held_out, 1, seed=seed)
    record = surrogate.record
    earlier = [Samples(*(np.array(part) for part in record["added"]))] if "added" in record else []
    extra = joined([*earlier, added])
    bench = make_bench(first)
    new = prepare_physics(bench.physics.domain, extra)
    physics = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), bench.physics, new)
    steps = PASSES * -(-physics.count // BATCH)
    plan = dataclasses.replace(first, samples=physics.count, iterations=steps)
    return plan, bench._replace(physics=physics, network=surrogate.network)


def joined(samples: list[Samples]) -> Samples:
    """Samples one after another."""
    return Samples(*(np.concatenate(parts) for parts in zip(*samples, strict=True)))


def _cases(record) -> Iterator[tuple[np.ndarray, float, float]]:
    """Body, Re and verified Cd of a run; runs of one Re alone have no list of cases."""
    try:
        if "cases" not in record:
            parameters = np.array([record["parameters"][name] for name in PARAMETERS], float)
            yield parameters, float(record["reynolds"]), float(record["cd_verified"])
        for case in record.get("cases", []):
            parameters = np.array(case["parameters"], float)
            yield parameters, float(case["reynolds"]), float(case["cd_verified"])
    except (KeyError, TypeError, ValueError):
        raise InvalidInput("refinement: a run lacks its verified drags") from None
