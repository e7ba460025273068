"""How fine a flow is solved, and what error that promises."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from surrogate.checks import expect, finite_number, whole_number
from surrogate.errors import InvalidInput

LONGEST_WINDOW = 40.0  # downstream, in D
FEWEST_CELLS = 6  # per D, if it can be: fewer do not resolve bodies of usual thickness
MOST_CELLS, MOST_IN_WINDOW = 128, 16e6  # per D, and in a window of the plane


@dataclasses.dataclass(frozen=True)
class Fidelity:
    """Resolution: ``cells`` per D, the window's reach in D, harmonics of the traction.

    ``promise`` is the relative error of the drag that it is made for (Re 0.5 to 45, aspect 0.5 to
    5; in space Re 0.1 to 100, aspect 0.5 to 4), which a solution's ``status`` says whether it is
    kept, ``wake`` how much window a wake takes: reach downstream in D per Re (height / D)^2.
    """

    name: str
    cells: int
    upstream: float
    downstream: float
    height: float
    harmonics: int = 7
    wake: float = 0.2
    promise: float = 0.015

    def __post_init__(self):
        expect("fidelity", self.name, str, "name")
        plain = {
            "cells": whole_number("cells per D", self.cells, 3, MOST_CELLS),
            "harmonics": whole_number("harmonics", self.harmonics, 1, 31),
        }
        lengths = dict.fromkeys(("upstream", "downstream", "height"), (1, 2 * LONGEST_WINDOW))
        for name, (low, high) in {**lengths, "wake": (0, 1), "promise": (0, 1)}.items():
            plain[name] = finite_number(name, getattr(self, name))
            if not low <= plain[name] <= high:
                raise InvalidInput(f"fidelity: {name} {plain[name]:g}: from {low:g} to {high:g}")
        area = (plain["upstream"] + plain["downstream"]) * plain["height"]
        if (count := plain["cells"] ** 2 * area) > MOST_IN_WINDOW:
            raise InvalidInput(
                f"fidelity: a window of {count / 1e6:.0f} million cells; up to "
                f"{MOST_IN_WINDOW / 1e6:g} are solved"
            )
        for name, value in plain.items():
            object.__setattr__(self, name, value)

    def reaching(self, reynolds: float, height: float) -> "Fidelity":
        """The same for bodies of this height at up to this Re: bluff ones need a longer window."""
        missing = min(self.wake * reynolds * height**2, LONGEST_WINDOW) - self.downstream
        if missing <= 2:
            return self
        longer = self.downstream + 8 * math.ceil(missing / 8)
        return dataclasses.replace(self, downstream=longer, height=self.height + 4)

    def coarser(self) -> "Fidelity":
        """Two thirds of the cells; of few enough, those that bodies of usual thickness need."""
        fewest = min(self.cells - 2, FEWEST_CELLS)
        return dataclasses.replace(self, cells=max(round(2 * self.cells / 3), fewest))

    def smaller(self, share: float) -> "Fidelity":
        """A share of the window."""
        return dataclasses.replace(
            self,
            upstream=share * self.upstream,
            downstream=share * self.downstream,
            height=share * self.height,
        )


LEVELS = {
    2: (
        Fidelity("draft", 10, 4, 8, 8, wake=0.15, promise=0.015),
        Fidelity("standard", 16, 6, 12, 8, wake=0.2, promise=0.004),
        Fidelity("fine", 32, 8, 20, 12, wake=0.3, promise=0.001),
    ),
    3: (
        Fidelity("draft", 8, 3, 6, 4, wake=0.0, promise=0.02),
        Fidelity("standard", 16, 3, 6, 4, wake=0.0, promise=0.005),
        Fidelity("fine", 24, 4, 8, 6, wake=0.0, promise=0.001),
    ),
}
NAMED = {dimension: {f.name: f for f in levels} for dimension, levels in LEVELS.items()}
FIDELITIES, SPACE_FIDELITIES = NAMED[2], NAMED[3]


def read_fidelity(value: Any, dimension: int = 2) -> Fidelity:
    """A fidelity by its name, or by a table of its numbers; in space the names mean others.

    Raises:
      InvalidInput: there is none of this name, or a number is missing or makes no sense.
    """
    if isinstance(value, Fidelity):
        return value
    if not isinstance(value, Mapping):
        levels = NAMED[dimension]
        if not isinstance(value, str) or value not in levels:
            raise InvalidInput(f"fidelity {value!r}: one of {', '.join(levels)}")
        return levels[value]
    try:
        return Fidelity(**{"name": "custom", **value})
    except TypeError:
        fields = ", ".join(field.name for field in dataclasses.fields(Fidelity))
        raise InvalidInput(f"fidelity: a name, or a table of {fields}") from None
