"""Which method, how many samples and steps: one training completely, and the presets."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Literal, get_args

from surrogate.checks import finite_number, whole_number
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene
from surrogate.training.methods.dp import (
    differentiable_physics,
    published_differentiable_physics,
)
from surrogate.training.methods.hig import (
    half_inverse_gradients,
    published_half_inverse_gradients,
)
from surrogate.training.methods.method import Method
from surrogate.training.methods.sip import scale_invariant_physics
from surrogate.training.methods.supervised import supervised

MethodName = Literal["dp", "sip", "hig", "supervised"]
MAKERS: dict[MethodName, Callable[..., Method]] = {
    "dp": differentiable_physics,
    "sip": scale_invariant_physics,
    "hig": half_inverse_gradients,
    "supervised": supervised,
}
PUBLISHED: dict[MethodName, Callable[..., Method]] = {
    "dp": published_differentiable_physics,
    "sip": functools.partial(scale_invariant_physics, modes=1.0, slopes=0.0),
    "hig": published_half_inverse_gradients,
    "supervised": functools.partial(supervised, modes=1.0, slopes=0.0),
}
METHODS: tuple[MethodName, ...] = get_args(MethodName)
REPORTS = 15  # of a training, about
FEW = ("sip", "hig")  # methods that are compared on a quarter of the bodies too


@dataclasses.dataclass(frozen=True)
class Preset:
    """How much a training takes: samples, held-out bodies, iterations by method.

    ``published`` are the iterations of the methods as they were published, where they take others.
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


@dataclasses.dataclass(frozen=True)
class Plan:
    """One training, completely: what is repeated from a checkpoint must be equal in all of this.

    ``published`` is the method as it was published, else it is the method at its best. With
    ``budget_s`` the schedule follows the clock and ``iterations`` is only an upper bound.
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

    def make_method(self) -> Method:
        return (PUBLISHED if self.published else MAKERS)[self.method]()


def make_plan(
    scene: Scene | None,
    method: str,
    preset: str = "full",
    samples: int | None = None,
    seed: int = 0,
    budget_seconds: float | None = None,
    published: bool = False,
) -> Plan:
    """The plan of a preset, with another scene or number of samples where they are given.

    Raises:
      InvalidInput: no such method or preset, or a number that makes no sense.
    """
    if not isinstance(method, str) or method not in METHODS:
        raise InvalidInput(f"method {method!r}: one of {', '.join(METHODS)}")
    if not isinstance(preset, str) or preset not in PRESETS:
        raise InvalidInput(f"preset {preset!r}: one of {', '.join(PRESETS)}")
    chosen = PRESETS[preset]
    if scene is not None and not isinstance(scene, Scene):
        raise InvalidInput(f"training: {scene!r} is no Scene")
    if budget_seconds is not None:
        budget_seconds = finite_number("budget in seconds", budget_seconds)
        if not 1 <= budget_seconds < 1e6:
            raise InvalidInput(f"budget {budget_seconds:g} s: from 1 to below 1e6")
    iterations = ((published and chosen.published) or chosen.iterations)[method]
    return Plan(
        method=method,
        scene=Scene() if scene is None else scene,
        samples=whole_number("samples", chosen.samples if samples is None else samples, 4, 10**6),
        held_out=chosen.held_out,
        iterations=10**6 if budget_seconds else iterations,
        seed=whole_number("seed", seed, 0, 2**31 - 1),
        budget_s=budget_seconds,
        report_every=max(1, iterations // REPORTS),
        published=published,
    )


def compared_plans(
    scene: Scene | None,
    preset: str,
    samples: int | None = None,
    seed: int = 0,
    budget_seconds: float | None = None,
) -> dict[str, Plan]:
    """All trainings that are compared, by name: every method at its best.

    In full also every method as it was published, and the best on a quarter of the bodies.
    """
    count = PRESETS[preset].samples if samples is None else samples

    def plan(method, published=False, count=count):
        return make_plan(scene, method, preset, count, seed, budget_seconds, published)

    plans = {method: plan(method) for method in METHODS}
    if preset == "full":
        few = max(4, count // 4)
        plans |= {f"{method}, as published": plan(method, True) for method in METHODS}
        plans |= {f"{method}, {few} bodies": plan(method, count=few) for method in FEW}
    return plans
