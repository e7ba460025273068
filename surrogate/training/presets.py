"""Which method, how many samples and steps: the two presets of every method."""

import dataclasses
from typing import Literal, get_args

from surrogate.errors import InvalidInput
from surrogate.scene import FIDELITIES, Scene
from surrogate.training.dp import differentiable_physics
from surrogate.training.hig import half_inverse_gradients
from surrogate.training.method import Method
from surrogate.training.sip import scale_invariant_physics
from surrogate.training.supervised import supervised

MethodName = Literal["dp", "sip", "hig", "supervised"]
PresetName = Literal["quick", "full"]
METHODS: tuple[MethodName, ...] = get_args(MethodName)


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
        match self.method:
            case "dp":
                return differentiable_physics()
            case "sip":
                return scale_invariant_physics()
            case "hig":
                return half_inverse_gradients()
            case "supervised":
                return supervised()


def preset(method: str, name: PresetName, seed: int = 0, budget_s: float | None = None) -> Plan:
    """The plan of a preset: ``quick`` on the draft grid, ``full`` on the standard one.

    Raises:
      InvalidInput: no such method, or a budget or seed that makes no sense.
    """
    if method not in METHODS:
        raise InvalidInput(f"method {method!r}: one of {', '.join(METHODS)}")
    if budget_s is not None and not 1 <= budget_s < 1e6:
        raise InvalidInput(f"budget {budget_s:g} s: must be at least 1 second")
    if not 0 <= seed < 2**31:
        raise InvalidInput(f"seed {seed}: must be a whole number from 0 to 2147483647")
    iterations = {
        "quick": {"dp": 1200, "sip": 160, "hig": 60, "supervised": 160},
        "full": {"dp": 4000, "sip": 1600, "hig": 160, "supervised": 1600},
    }[name][method]
    samples, held_out, fidelity = {"quick": (128, 48, "draft"), "full": (512, 128, "standard")}[
        name
    ]
    return Plan(
        method=method,
        scene=Scene(fidelity=FIDELITIES[fidelity]),
        samples=samples,
        held_out=held_out,
        iterations=10**6 if budget_s else iterations,
        seed=seed,
        budget_s=budget_s,
        report_every=max(1, iterations // 15),
    )
