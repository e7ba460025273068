"""Distributions of an uncertain Reynolds number, and even draws from one seed."""

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy import stats

from surrogate.arrays import Number
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput


@dataclasses.dataclass(frozen=True)
class LogNormal:
    """log Re is normal about the log of the nominal Re, with standard deviation ``spread``."""

    spread: Number

    def __post_init__(self):
        object.__setattr__(self, "spread", finite_number("spread", self.spread))
        if not 0 <= self.spread <= 2:
            raise InvalidInput(f"spread {self.spread:g}: from 0 to 2, of log Re")

    def around(self, nominal: float) -> Any:
        """The distribution, a frozen one of SciPy's; ``spread`` above 0."""
        return stats.lognorm(s=self.spread, scale=nominal)


@dataclasses.dataclass(frozen=True)
class Uniform:
    """Re is uniform within the relative ``spread`` on both sides of the nominal Re."""

    spread: Number

    def __post_init__(self):
        object.__setattr__(self, "spread", finite_number("spread", self.spread))
        if not 0 <= self.spread < 1:
            raise InvalidInput(f"spread {self.spread:g}: from 0 to below 1, of Re")

    def around(self, nominal: float) -> Any:
        """The distribution, a frozen one of SciPy's; ``spread`` above 0."""
        return stats.uniform(nominal * (1 - self.spread), 2 * nominal * self.spread)


def latin_hypercube(seed: int, count: int, columns: int) -> Float[np.ndarray, "count columns"]:
    """Uniform in [0, 1), one draw in every count-th part of every column."""
    return stats.qmc.LatinHypercube(columns, rng=seed).random(count)
