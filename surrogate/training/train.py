"""Train a surrogate, or one by every method, and save it to a folder."""

import time
from collections.abc import Mapping
from pathlib import Path

from surrogate.checks import flag
from surrogate.devices import Devices, choose_devices
from surrogate.files import JsonObject
from surrogate.model.store import load, save, warn_of_inaccuracy
from surrogate.model.surrogate import Surrogate
from surrogate.processes import first
from surrogate.progress import progress_bar
from surrogate.scene.scene import Scene
from surrogate.training.history import HistoryPoint
from surrogate.training.loop import TrainingResult, run_training
from surrogate.training.methods.labels import TrainingLabels
from surrogate.training.methods.method import LabelStore
from surrogate.training.plan import Plan, make_plan
from surrogate.training.record import measured_anew, surrogate_of
from surrogate.training.setup import TrainingSetup, make_setup
from surrogate.training.stored import checkpoint_path, stored_training


def train(
    scene: Scene | None = None,
    method: str = "hig",
    *,
    samples: int | None = None,
    held_out: int | None = None,
    preset: str = "quick",
    seed: int = 0,
    budget_seconds: float | None = None,
    published: bool = False,
    out: str | Path | None = None,
    progress: bool = True,
    devices: int | None = None,
    device_batch: int | None = None,
    overwrite: bool = False,
    infill_from: str | Path | Surrogate | None = None,
    width: int | None = None,
) -> Surrogate:
    """Train a small network that predicts the loads of a scene's bodies, using the flow solver.

    The methods differ in how the solver enters the update of the network's weights:

    - ``"hig"``, half-inverse gradients (Schnell, Holl, Thuerey 2022): each flow and its adjoint are
      solved once; each step inverts the Jacobian of all residuals half way. The default: of
      drag alone the most accurate for its cost, in fewest steps.
    - ``"sip"``, scale-invariant physics (Holl, Koltun, Thuerey 2022): each evaluation is a few
      Newton steps of the solver, to whose result Adam fits the network. About as accurate; choose
      it for large networks, where the Jacobian of HIG becomes expensive.
    - ``"supervised"``: each flow is solved once, Adam fits the network. The most
      accurate where drag, lift and moment are trained on few bodies.
    - ``"dp"``, differentiable physics (Um et al. 2020): Adam follows the gradient of a loss on the
      slip at the wall, through the flow solver or its linearisation. The least accurate of drag
      alone, and of three loads on more than a few bodies; for comparison.

    By default every method runs at its best: it also fits the loads' gradients in shape and Re,
    which one adjoint solve per load provides (Sobolev training, Czarnecki et al. 2017).
    ``published=True`` runs it as in its paper, for comparison. The equations are in
    ``surrogate/training/README.md``, measured errors and costs in ``scripts/measure/RESULTS.md``.

    Args:
      scene: stream, Reynolds numbers, fidelity and family of bodies; ``Scene()`` if None.
      method: "dp", "sip", "hig" or "supervised".
      samples: number of training bodies, from 4, in place of the preset's.
      held_out: number of held-out bodies, from 4, on which errors and their bounds are measured, in
        place of the preset's (quick 48, full 128); bounds that cover 95 % take 19 at least.
      preset: "quick" (64 bodies), the default, or "full" (256 bodies and more steps).
      seed: of samples, held-out bodies and initial weights.
      budget_seconds: train for this many seconds, in place of the preset's steps; compilation,
        set-up and held-out flows come on top.
      published: the method as published instead of at its best.
      out: folder to save to. If interrupted, the same call resumes from a checkpoint beside it; if
        finished, it returns the surrogate that is there; with another ``held_out`` its errors are
        measured anew.
      progress: whether to show progress on stderr.
      devices: number of devices over which the flows are distributed; by default 1.
      device_batch: batch size per device: flows solved simultaneously on one device; by default 1
        on a CPU, 32 elsewhere.
      overwrite: train even if the folder holds a surrogate, and replace it.
      infill_from: a surrogate of the same scene and seed, or its folder, trained on fewer samples.
        Its samples are taken again, and those where its error bounds are largest; the network
        starts from its initial weights, and all flows are solved.
      width: of both hidden layers of the network; by default 20, and 32 with lift.

    Returns:
      The surrogate; its ``record`` has the loads' mean and largest errors on held-out bodies. A
      warning says where these are large (``Surrogate.inaccuracy``).

    Raises:
      InvalidInput: an argument is invalid, or the folder holds another training or something else.
      NotConverged: more than a tenth of the held-out flows, or the training, did not converge.
    """
    overwrite = flag("overwrite", overwrite)
    known = infill_from is None or isinstance(infill_from, Surrogate)
    infill_from = infill_from if known else load(infill_from)
    numbers = preset, samples, seed, budget_seconds, published, held_out
    plan = make_plan(scene, method, *numbers, infill_from, width)
    chosen = choose_devices(devices, device_batch)
    surrogate = train_plan(plan, out, progress, chosen, overwrite=overwrite)
    warn_of_inaccuracy(surrogate, f"training by {method}", stacklevel=3)
    return surrogate


def train_plan(
    plan: Plan,
    out: str | Path | None,
    progress: bool = True,
    devices: Devices | None = None,
    setup: TrainingSetup | None = None,
    title: str | None = None,
    overwrite: bool = False,
    notes: JsonObject | None = None,
) -> Surrogate:
    """Train a surrogate by a plan and save it, or return the one that is saved already.

    As ``train``, but without a warning of large errors. If a saved surrogate differs from the plan
    in the number of held-out bodies alone, its errors are measured anew, unless ``overwrite`` is
    set. In a multi-process run the first process writes.

    Args:
      plan: of the training.
      out: folder to save to, with a checkpoint beside it; None to save nothing.
      progress: whether to show progress on stderr.
      devices: over which the flows are distributed; by default those of ``choose_devices``.
      setup: from ``make_setup`` for this plan, or one of equal scene, seed, counts, infill and
        width that several trainings share; by default it is made here, on these devices.
      title: of the progress bar; by default the method's name.
      overwrite: train even if the folder holds a surrogate, and replace it.
      notes: added to the record of a new training.

    Returns:
      The surrogate.

    Raises:
      InvalidInput: the folder holds another training and ``overwrite`` is not set, or something
        else; or a body of the samples does not fit the grid.
      NotConverged: more than a tenth of the held-out flows, or the training, did not converge.
    """
    stored = None if out is None else stored_training(plan, out, overwrite)
    if stored is not None and not overwrite:
        with progress_bar(f"training {title or plan.method}", progress) as update:
            if is_measured(stored, plan):
                update(1.0, f"already done in {out}")
                return stored
            update(0.0, f"done in {out}; its errors are measured on {plan.held_out} bodies")
            surrogate = measured_anew(
                plan,
                stored,
                devices or choose_devices(),
                lambda count, of: update(count / of, f"held-out flows {count} of {of}"),
            )
            if first():
                save(out, surrogate)
            update(1.0, "")
        return surrogate
    checkpoint = None if out is None else checkpoint_path(out)
    setup = setup or setup_with_bar(plan, devices, progress)
    trained = train_with_bar(plan, setup, checkpoint, title, progress)
    surrogate = surrogate_of(plan, trained, setup, notes)
    if out is not None and first():
        save(out, surrogate)
        checkpoint.unlink(missing_ok=True)
    return surrogate


def train_all(
    plans: Mapping[str, Plan],
    out: Path,
    devices: Devices | None = None,
    overwrite: bool = False,
) -> dict[str, Surrogate]:
    """Train a surrogate per plan, in folders of the plans' names; load those already trained.

    Plans of equal scene, seed, counts, infill and width share samples, held-out bodies and initial
    weights. A warning says where the errors of a surrogate are large.

    Args:
      plans: by the names of their folders.
      out: folder of these folders.
      devices: over which the flows are distributed; by default those of ``choose_devices``.
      overwrite: train anew where a folder holds a surrogate of another plan, or one measured on
        another number of held-out bodies, and replace it.

    Returns:
      The surrogates by the same names.

    Raises:
      InvalidInput: a folder holds something else, or a surrogate of another plan and ``overwrite``
        is not set.
      NotConverged: as ``train_plan``.
    """
    surrogates = {
        name: stored_training(plan, out / name, overwrite) for name, plan in plans.items()
    }
    setups: dict[tuple, TrainingSetup] = {}
    for name, plan in plans.items():
        found = surrogates[name]
        if found is None or not is_measured(found, plan):
            setup = None
            if found is None:
                key = plan.scene, plan.seed, plan.samples, plan.infill, plan.width, plan.held_out
                setup = setups[key] = setups.get(key) or setup_with_bar(plan, devices)
            surrogates[name] = train_plan(
                plan, out / name, devices=devices, setup=setup, title=name, overwrite=overwrite
            )
        warn_of_inaccuracy(surrogates[name], f"surrogate {out / name}", stacklevel=3)
    return surrogates


def is_measured(surrogate: Surrogate, plan: Plan) -> bool:
    """Return whether the errors of a plan's surrogate are those on the plan's held-out bodies."""
    return surrogate.record.get("held_out") == plan.held_out


def setup_with_bar(plan: Plan, devices: Devices | None, progress: bool = True) -> TrainingSetup:
    """Make the setup of a training as ``make_setup`` does, with progress on stderr."""
    start = time.perf_counter()
    with progress_bar("preparing flows", progress) as update:
        update(0.0, f"{plan.samples} bodies, {plan.held_out} held out")

        def report(done: int, of: int) -> None:
            left = f"; Oseen flows of {plan.samples} bodies" if done == of else ""
            update(done / (of + plan.samples / 2), f"held-out flows {done} of {of}{left}")

        setup = make_setup(plan, devices, report)
        failed = f", {setup.held_out_failed} held-out flows failed" if setup.held_out_failed else ""
        update(1.0, f"in {time.perf_counter() - start:.0f} s{failed}")
    return setup


def train_with_bar(
    plan: Plan,
    setup: TrainingSetup,
    checkpoint: Path | None,
    title: str | None,
    progress: bool,
) -> TrainingResult:
    """Train as ``run_training`` does, with progress on stderr.

    Args:
      plan: as for ``run_training``.
      setup: as for ``run_training``.
      checkpoint: as for ``run_training``.
      title: of the progress bar; None for the method's name.
      progress: whether to show progress.
    """
    with progress_bar(f"training {title or plan.method}", progress) as update:

        def report(point: HistoryPoint, done: float) -> None:
            update(
                done,
                f"step {point.iteration}: error mean {100 * point.error_mean:.2f} % "
                f"max {100 * point.error_max:.2f} %, G {point.green_applications}",
            )

        def evaluating(done: float, labels: LabelStore) -> None:
            if isinstance(labels, TrainingLabels):
                update(done, labels.progress)

        trained = run_training(plan, setup, checkpoint, report, evaluating=evaluating)
        if trained.stopped:
            update(1.0, f"{trained.stopped}; the last good weights are kept")
        elif trained.unsolved:
            update(1.0, f"flows of {trained.unsolved} of {plan.samples} samples are not solved yet")
    return trained
