"""The plan of a training: scene, method, numbers of samples and iterations; the presets."""

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Literal, get_args

from surrogate.checks import expect, finite_number, flag, whole_number
from surrogate.errors import InvalidInput
from surrogate.model.network import default_width
from surrogate.model.surrogate import Surrogate
from surrogate.scene.samples import LARGEST_SEED, Samples, training_samples
from surrogate.scene.scene import Scene
from surrogate.training.infill import infill_positions
from surrogate.training.methods.dp import DifferentiablePhysics, PublishedDifferentiablePhysics
from surrogate.training.methods.hig import HalfInverseGradients, PublishedHalfInverseGradients
from surrogate.training.methods.inversion import Inversion
from surrogate.training.methods.method import Method
from surrogate.training.methods.sip import ScaleInvariantPhysics
from surrogate.training.methods.supervised import Supervised

MethodName = Literal["dp", "sip", "hig", "supervised"]
MAKERS: dict[MethodName, Callable[..., Method]] = {  # the methods at their best
    "dp": DifferentiablePhysics,
    "sip": ScaleInvariantPhysics,
    "hig": HalfInverseGradients,
    "supervised": Supervised,
}
PUBLISHED: dict[MethodName, Callable[..., Method]] = {
    "dp": PublishedDifferentiablePhysics,
    "sip": functools.partial(ScaleInvariantPhysics, modes=1.0, slopes=0.0),
    "hig": PublishedHalfInverseGradients,
    "supervised": functools.partial(Supervised, modes=1.0, slopes=0.0),
}
METHODS: tuple[MethodName, ...] = get_args(MethodName)
LIFTING_STEPS = 3  # times the steps of drag alone, where lift and moment are trained too
WIDEST = 128  # of hidden layers: error bounds take the gradients of all loads in all weights
# Of the training bodies in 3-D with incidence, made symmetric fore and aft. At low Re the moment of
# other bodies is nearly that in Stokes flow, and hides the moment by inertia.
SYMMETRIC_SHARE = 0.25
REPORTS = 15  # points in a training's history, about
# Evaluations of a sample in a training, on average, at least; a label by Newton steps takes 3 or 4.
EPOCHS = 8
FEW = ("sip", "hig")  # methods that are also compared on a quarter of the samples


@dataclasses.dataclass(frozen=True)
class Preset:
    """A preset of the numbers of samples, held-out samples and iterations.

    ``iterations`` are those of the methods at their best, ``published`` those of the methods as
    published where they differ.
    """

    samples: int
    held_out: int
    iterations: dict[MethodName, int]
    published: dict[MethodName, int]


PRESETS = {
    "quick": Preset(
        64,
        48,
        {"dp": 400, "sip": 160, "hig": 60, "supervised": 160},
        {},
    ),
    "full": Preset(
        256,
        128,
        {"dp": 1500, "sip": 400, "hig": 100, "supervised": 400},
        {"dp": 4000, "sip": 400, "hig": 40, "supervised": 400},
    ),
}
SAMPLES_HELP = ", ".join(f"{name}: {preset.samples}" for name, preset in PRESETS.items())
HELD_OUT_HELP = ", ".join(f"{name}: {preset.held_out}" for name, preset in PRESETS.items())


@dataclasses.dataclass(frozen=True)
class Plan:
    """The definition of a training; a checkpoint belongs to exactly one plan.

    Args:
      method: dp, sip, hig or supervised.
      scene: stream, Reynolds numbers, fidelity and family.
      samples: number of training samples.
      held_out: number of held-out samples.
      iterations: number of steps; with ``budget_s`` an upper bound.
      seed: of samples, batches and initial weights.
      budget_s: seconds of training, in place of ``iterations``.
      report_every: iterations between points of the history.
      published: the method as published instead of at its best.
      infill: positions of the last samples in the Sobol sequence (``infill_positions``); the others
        are the first of the sequence.
      earlier_green_applications: convolutions of the trainings whose surrogates chose the infill.
      width: of both hidden layers of the network; by default that of the scene.
      symmetric_share: of the training bodies that are made symmetric fore and aft; by default a
        quarter in scenes in 3-D with incidence, else none.
    """

    method: MethodName
    scene: Scene
    samples: int
    held_out: int
    iterations: int
    seed: int = 0
    budget_s: float | None = None
    report_every: int = 10
    published: bool = False
    infill: tuple[int, ...] = ()
    earlier_green_applications: int = 0
    width: int | None = None
    symmetric_share: float | None = None

    def __post_init__(self):
        object.__setattr__(self, "width", self.width or default_width(self.scene))
        if self.symmetric_share is None:
            share = _symmetric_share(self.scene)
            object.__setattr__(self, "symmetric_share", share)

    @property
    def training_samples(self) -> Samples:
        """Bodies and Reynolds numbers on which a network is trained."""
        drawn = self.seed, self.samples, self.infill, self.symmetric_share
        return training_samples(self.scene, *drawn)

    def make_method(self) -> Method:
        """Return the method; where its steps are few for the samples, its batches are larger.

        So samples are evaluated ``EPOCHS`` times on average, unless a budget ends the training.
        """
        method = (PUBLISHED if self.published else MAKERS)[self.method]()
        if not isinstance(method.evaluator, Inversion):  # no label of it is ever final
            return method
        least = math.ceil(EPOCHS * self.samples / self.iterations)
        return dataclasses.replace(method, batch=max(method.batch, least))


def make_plan(
    scene: Scene | None,
    method: str,
    preset: str = "full",
    samples: int | None = None,
    seed: int = 0,
    budget_seconds: float | None = None,
    published: bool = False,
    held_out: int | None = None,
    infill_from: Surrogate | None = None,
    width: int | None = None,
) -> Plan:
    """Return the plan of a preset, whose numbers are replaced by those that are given.

    Scenes whose bodies have lift get three times the preset's iterations.

    Args:
      scene: stream, Reynolds numbers, fidelity and family of bodies; ``Scene()`` if None.
      method: "dp", "sip", "hig" or "supervised".
      preset: "quick" or "full".
      samples: number of training samples, at least 4, in place of the preset's.
      seed: of samples, held-out samples, batches and initial weights.
      budget_seconds: seconds of training, from 1 to below 1e6, in place of the preset's iterations.
      published: the method as published instead of at its best.
      held_out: number of held-out samples, at least 4, in place of the preset's.
      infill_from: a surrogate of the same scene and seed, trained on fewer samples. Its samples
        are taken again, and those where its error bounds are largest.
      width: of both hidden layers of the network, in place of the scene's (20, with lift 32).

    Raises:
      InvalidInput: no such method or preset, a number is out of range, or ``infill_from`` is of
        another scene or seed or of as many samples.
    """
    if not isinstance(method, str) or method not in METHODS:
        raise InvalidInput(f"method {method!r}: one of {', '.join(METHODS)}")
    if not isinstance(preset, str) or preset not in PRESETS:
        raise InvalidInput(f"preset {preset!r}: one of {', '.join(PRESETS)}")
    chosen = PRESETS[preset]
    published = flag("published", published)
    expect("training", scene, Scene | None, "Scene")
    if budget_seconds is not None:
        budget_seconds = finite_number("budget in seconds", budget_seconds)
        if not 1 <= budget_seconds < 1e6:
            raise InvalidInput(f"budget {budget_seconds:g} s: from 1 to below 1e6")
    scene = Scene() if scene is None else scene
    iterations = ((published and chosen.published) or chosen.iterations)[method]
    if scene.family.has_lift:
        iterations *= LIFTING_STEPS
    samples = whole_number("samples", chosen.samples if samples is None else samples, 4, 10**6)
    held_out = chosen.held_out if held_out is None else held_out
    held_out = whole_number("held-out bodies", held_out, 4, 10**6)
    seed = whole_number("seed", seed, 0, LARGEST_SEED)
    width = None if width is None else whole_number("width", width, 1, WIDEST)
    infill, earlier = (), 0
    if infill_from is not None:
        earlier = infill_from.recorded("green_applications")
        earlier += infill_from.record.get("earlier_green_applications", 0)
        infill = infill_positions(infill_from, scene, seed, samples, _symmetric_share(scene))
    return Plan(
        method=method,
        scene=scene,
        samples=samples,
        infill=infill,
        earlier_green_applications=earlier,
        held_out=held_out,
        iterations=10**6 if budget_seconds else iterations,
        seed=seed,
        budget_s=budget_seconds,
        report_every=max(1, iterations // REPORTS),
        published=published,
        width=width,
    )


def _symmetric_share(scene):
    """Return the share of a scene's training bodies that are made symmetric fore and aft."""
    return SYMMETRIC_SHARE if scene.dimension == 3 and scene.family.has_lift else 0.0


def compared_plans(
    scene: Scene | None,
    preset: str,
    seed: int,
    samples: int | None = None,
    budget_seconds: float | None = None,
) -> dict[str, Plan]:
    """Return the plans of all trainings that the payoff command compares, by name.

    These are all methods at their best. With the preset full there are also all methods as
    published, and SIP and HIG at their best on a quarter of the samples.

    Args:
      scene: as for ``make_plan``.
      preset: "quick" or "full".
      seed: as for ``make_plan``.
      samples: number of training samples, in place of the preset's.
      budget_seconds: of each training, in place of the preset's iterations.

    Raises:
      InvalidInput: as ``make_plan``.
    """
    count = make_plan(scene, METHODS[0], preset, samples).samples

    def plan(method, published=False, count=count):
        return make_plan(scene, method, preset, count, seed, budget_seconds, published)

    plans = {method: plan(method) for method in METHODS}
    if preset == "full":
        few = max(4, count // 4)
        plans |= {f"{method}, as published": plan(method, True) for method in METHODS}
        plans |= {f"{method}, {few} bodies": plan(method, count=few) for method in FEW}
    return plans
