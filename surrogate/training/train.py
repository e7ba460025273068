"""Train a surrogate, or one of every method, from a scene to a folder."""

from collections.abc import Mapping
from pathlib import Path

from surrogate.devices import Devices, choose_devices
from surrogate.errors import InvalidInput
from surrogate.model.store import RECORD, check_surrogate_folder, load, save
from surrogate.model.surrogate import Surrogate
from surrogate.processes import first
from surrogate.progress import progress_bar
from surrogate.scene.scene import Scene
from surrogate.training.loop import TrainingResult, TrainingSetup, make_setup, run_training
from surrogate.training.methods.method import Method
from surrogate.training.plan import Plan, make_plan
from surrogate.training.record import is_of, surrogate_of


def train(
    scene: Scene | None = None,
    method: str = "hig",
    *,
    samples: int | None = None,
    preset: str = "full",
    seed: int = 0,
    budget_seconds: float | None = None,
    published: bool = False,
    out: str | Path | None = None,
    progress: bool = True,
    devices: int | None = None,
    lanes: int | None = None,
) -> Surrogate:
    """Train a network on the flows of a scene.

    Args:
      scene: what to model; ``Scene()`` if None.
      method: dp, sip, hig or supervised.
      samples: bodies to learn from, instead of the preset's.
      preset: quick or full, which says how long to train.
      seed: of samples, held-out bodies and initial weights.
      budget_seconds: train for so long instead.
      published: the method as it was published, not at its best.
      out: folder to save it in. Interrupted, the same call goes on where it stopped.
      progress: show it on stderr.
      devices: over which bodies are spread; one where nothing is said.
      lanes: bodies solved at once on a device, as many as pay there where nothing is said.

    Raises:
      InvalidInput: an argument makes no sense, or the folder is not for surrogates.
      NotConverged: a held-out flow was not found, or the training blew up at once.
    """
    plan = make_plan(scene, method, preset, samples, seed, budget_seconds, published)
    return carry_out(plan, out, progress, choose_devices(devices, lanes))


def carry_out(
    plan: Plan, out: str | Path | None, progress: bool, devices: Devices | None = None
) -> Surrogate:
    """Train by a plan; as ``train``. Of many processes the first writes."""
    if out is not None:
        check_surrogate_folder(out)
    checkpoint = None if out is None else checkpoint_of(out)
    bench = prepare(plan, progress, devices)
    trained = train_with_bar(plan, bench, checkpoint, progress=progress)
    surrogate = surrogate_of(plan, trained, bench)
    if out is not None and first():
        save(out, surrogate)
        checkpoint.unlink(missing_ok=True)
    return surrogate


def train_all(
    plans: Mapping[str, Plan], out: Path, devices: Devices | None = None
) -> dict[str, Surrogate]:
    """A surrogate per plan, in folders of their names; those already trained are loaded.

    Plans of the same scene, seed and counts share their samples, held-out bodies and weights.

    Raises:
      InvalidInput: a folder holds something else, or a surrogate of another plan.
    """
    for name in plans:
        check_surrogate_folder(out / name)
    benches: dict[tuple, TrainingSetup] = {}
    surrogates = {}
    for name, plan in plans.items():
        if not (out / name / RECORD).is_file():
            ground = plan.scene, plan.seed, plan.samples, plan.held_out
            bench = benches[ground] = benches.get(ground) or prepare(plan, devices=devices)
            checkpoint = checkpoint_of(out / name)
            trained = train_with_bar(plan, bench, checkpoint, title=name)
            save(out / name, surrogate_of(plan, trained, bench))
            checkpoint.unlink(missing_ok=True)
        surrogates[name] = load(out / name)
        if not is_of(plan, surrogates[name]):
            raise InvalidInput(
                f"{out / name}: is of another method, preset or seed; choose another folder"
            )
    return surrogates


def prepare(plan: Plan, progress: bool = True, devices: Devices | None = None) -> TrainingSetup:
    """The plan's bench, with progress on stderr."""
    with progress_bar("preparing flows", progress) as update:
        update(0.0, f"{plan.samples} bodies, {plan.held_out} held out")
        bench = make_setup(plan, devices)
        update(1.0, f"in {bench.setup_s:.0f} s")
    return bench


def train_with_bar(
    plan: Plan,
    bench: TrainingSetup,
    checkpoint: Path | None = None,
    method: Method | None = None,
    title: str | None = None,
    progress: bool = True,
) -> TrainingResult:
    """Train with progress on stderr; ``method`` and ``title`` replace the plan's own."""
    with progress_bar(f"training {title or plan.method}", progress) as update:

        def report(point, done):
            update(
                done,
                f"step {point.iteration}: error mean {100 * point.error_mean:.2f} % "
                f"max {100 * point.error_max:.2f} %, G {point.green_applications}",
            )

        trained = run_training(plan, bench, checkpoint, report, method=method)
        if trained.stopped:
            update(1.0, f"{trained.stopped}; the last good weights are kept")
    return trained


def checkpoint_of(folder: str | Path) -> Path:
    """The file beside a surrogate's folder from which an interrupted training goes on."""
    place = Path(folder).resolve()
    return place.with_name(place.name + ".checkpoint")
