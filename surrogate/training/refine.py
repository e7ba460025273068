"""A surrogate trained on where its optima and the flow disagree."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from surrogate.arrays import AnyArray
from surrogate.body.family import ROOMY, opening
from surrogate.errors import InvalidInput
from surrogate.model.store import check_surrogate_folder, save
from surrogate.model.surrogate import Surrogate
from surrogate.progress import progress_bar
from surrogate.scene.scene import Scene
from surrogate.training.loop import Bench, make_bench
from surrogate.training.methods.supervised import supervised
from surrogate.training.physics import prepare_physics
from surrogate.training.plan import Plan
from surrogate.training.record import surrogate_of
from surrogate.training.samples import Samples, joined
from surrogate.training.train import train_with_bar

DEVIATION = 0.05  # of the new samples around an optimum, over the width of every range
BATCH = 8  # of supervised training
PASSES = 12  # over all samples: the first solves their flows
LEARNING_RATE = 1e-3  # a third of a fresh training's: the weights are nearly right


class KnownDrag(NamedTuple):
    """A body whose drag the flow has told."""

    parameters: AnyArray
    reynolds: float
    drag: float


def refine(
    surrogate: Surrogate,
    verified: Sequence[KnownDrag],
    tolerance: float | None = None,
    around: int = 16,
    out: str | Path | None = None,
) -> Surrogate:
    """Solve ``around`` flows near every body where the surrogate is off, and train on with them.

    ``tolerance`` is the relative gap that is let be; the surrogate's mean error if None. The record
    gains ``gap_before`` and ``gap_after``, the largest of these gaps, and ``added`` samples.

    Raises:
      InvalidInput: no gap is larger, or the record does not say how the surrogate was trained.
      NotConverged: a flow was not found.
    """
    if out is not None:
        check_surrogate_folder(out)
    if not 1 <= around <= 1000:
        raise InvalidInput(f"refinement: {around} flows around every body; from 1 to 1000")
    if tolerance is None:
        tolerance = surrogate.recorded("drag_error_mean")
    wide = [body for body in verified if _gap(surrogate, body) > tolerance]
    if not wide:
        raise InvalidInput(
            f"refinement: no body differs from the flow by more than {100 * tolerance:.2g} %; "
            "a smaller tolerance would find some"
        )
    key = jax.random.fold_in(jax.random.key(surrogate.recorded("seed")), len(wide))
    new = samples_around(surrogate.scene, wide, around, key)
    kept = surrogate.record.get("added")
    added = joined([*([Samples(*map(np.array, kept))] if kept else []), new])
    with progress_bar("preparing flows") as progress:
        plan, bench = _widened(surrogate, added)
        progress(1.0, f"{plan.samples} bodies, {new.count} of them new")
    trained = train_with_bar(plan, bench, method=supervised(learning_rate=LEARNING_RATE))
    refined = dataclasses.replace(surrogate, network=trained.network)
    result = surrogate_of(
        plan,
        trained,
        bench.setup_s,
        samples=surrogate.recorded("samples"),  # of the first training; the others are in "added"
        added=[np.asarray(part).tolist() for part in added],
        gap_before=max(_gap(surrogate, body) for body in wide),
        gap_after=max(_gap(refined, body) for body in verified),
        samples_added=new.count,
    )
    if out is not None:
        save(out, result)
    return result


def samples_around(
    scene: Scene, bodies: Sequence[KnownDrag], count: int, key: jax.Array
) -> Samples:
    """Every body itself and ``count`` normal draws around it, cut to the trained ranges."""
    bounds = np.concatenate([scene.family.bounds, np.log([scene.reynolds])])
    low, high = bounds.T
    centres = np.array([[*body.parameters, np.log(body.reynolds)] for body in bodies])
    normal = jax.random.normal(key, (len(bodies), count, len(low)), float)
    around = centres[:, None] + DEVIATION * (high - low) * np.asarray(normal)
    around = np.clip(around.reshape(-1, len(low)), low, high)
    open_ = jax.vmap(lambda row: opening(row[:-1], scene.family.modes))(jnp.asarray(around))
    rows = np.concatenate([centres, around[np.asarray(open_) > ROOMY]])
    return Samples(rows[:, :-1], np.exp(rows[:, -1]))


def _gap(surrogate: Surrogate, body: KnownDrag) -> float:
    predicted = surrogate.drag(np.asarray(body.parameters), body.reynolds, extrapolate=True)
    return abs(float(predicted) / body.drag - 1)


def _widened(surrogate: Surrogate, added: Samples) -> tuple[Plan, Bench]:
    """Plan and bench of a supervised training that goes on from the surrogate's weights.

    The samples of its first training are drawn again from its seed, so that it does not forget.
    """
    samples, held_out, seed = map(surrogate.recorded, ("samples", "held_out", "seed"))
    first = Plan("supervised", surrogate.scene, samples, held_out, 1, seed=seed)
    bench = make_bench(first)
    new = prepare_physics(bench.physics.flow, Samples(*map(jnp.asarray, added)))
    physics = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), bench.physics, new)
    steps = PASSES * -(-physics.count // BATCH)
    plan = dataclasses.replace(first, samples=physics.count, iterations=steps)
    return plan, bench._replace(physics=physics, network=surrogate.network)
