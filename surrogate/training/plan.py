"""Which method, how many samples and steps: one training completely, and the presets."""

import dataclasses
from collections.abc import Callable
from typing import Literal, get_args

from surrogate.checks import finite_number, whole_number
from surrogate.errors import InvalidInput
from surrogate.scene.fidelity import FIDELITIES
from surrogate.scene.scene import Scene
from surrogate.training.methods.dp import differentiable_physics
from surrogate.training.methods.hig import half_inverse_gradients
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
METHODS: tuple[MethodName, ...] = get_args(MethodName)
REPORTS = 15  # of a training, about


@dataclasses.dataclass(frozen=True)
class Preset:
    """How much a training takes: samples, held-out bodies, iterations by method, and a scene."""

    samples: int
    held_out: int
    iterations: dict[MethodName, int]
    scene: Scene


PRESETS = {
    "quick": Preset(
        128,
        48,
        {"dp": 1200, "sip": 160, "hig": 60, "supervised": 160},
        Scene(fidelity=FIDELITIES["draft"]),
    ),
    "full": Preset(512, 128, {"dp": 4000, "sip": 1600, "hig": 160, "supervised": 1600}, Scene()),
}


@dataclasses.dataclass(frozen=True)
class Plan:
    """One training, completely: what is repeated from a checkpoint must be equal in all of this.

    With ``budget_s`` the schedule follows the clock and ``iterations`` is only an upper bound.
    """

    method: MethodName
    scene: Scene
    samples: int
    held_out: int
    iterations: int
    seed: int = 0
    budget_s: float | None = None
    report_every: int = 10

    def make_method(self) -> Method:
        return MAKERS[self.method]()


def make_plan(
    scene: Scene | None,
    method: str,
    preset: str = "full",
    samples: int | None = None,
    seed: int = 0,
    budget_seconds: float | None = None,
) -> Plan:
    """The plan of a preset, with another scene or number of samples where they are given.

    Raises:
      InvalidInput: no such method or preset, or a number that makes no sense.
    """
    if method not in METHODS:
        raise InvalidInput(f"method {method!r}: one of {', '.join(METHODS)}")
    if preset not in PRESETS:
        raise InvalidInput(f"preset {preset!r}: one of {', '.join(PRESETS)}")
    chosen = PRESETS[preset]
    if scene is not None and not isinstance(scene, Scene):
        raise InvalidInput(f"training: {scene!r} is no Scene")
    if budget_seconds is not None:
        budget_seconds = finite_number("budget in seconds", budget_seconds)
        if not 1 <= budget_seconds < 1e6:
            raise InvalidInput(f"budget {budget_seconds:g} s: must be at least 1 second")
    iterations = chosen.iterations[method]
    return Plan(
        method=method,
        scene=chosen.scene if scene is None else scene,
        samples=whole_number("samples", chosen.samples if samples is None else samples, 4, 10**6),
        held_out=chosen.held_out,
        iterations=10**6 if budget_seconds else iterations,
        seed=whole_number("seed", seed, 0, 2**31 - 1),
        budget_s=budget_seconds,
        report_every=max(1, iterations // REPORTS),
    )
