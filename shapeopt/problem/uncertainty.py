"""Distributions of an uncertain Reynolds number, and Latin hypercube samples."""

import dataclasses
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
import scipy  # its submodules load at first use; scipy.stats takes half a second
from jaxtyping import Float

from surrogate.checks import finite_number
from surrogate.errors import InvalidInput


@runtime_checkable
class Distribution(Protocol):
    """A continuous distribution with the methods of ``scipy.stats``."""

    def cdf(self, x: Sequence[float]) -> np.ndarray:
        """Return the probabilities of values below ``x``."""
        ...

    def ppf(self, q: np.ndarray) -> np.ndarray:
        """Return the quantiles of the probabilities ``q``, the inverse of ``cdf``."""
        ...


@dataclasses.dataclass(frozen=True)
class LogNormal:
    """A distribution of Re: log Re is normally distributed about the log of the nominal Re.

    Args:
      spread: standard deviation of log Re, 0 to 2.
    """

    spread: float

    def __post_init__(self):
        object.__setattr__(self, "spread", finite_number("spread", self.spread))
        if not 0 <= self.spread <= 2:
            raise InvalidInput(f"spread {self.spread:g}: from 0 to 2, of log Re")

    def around(self, nominal: float) -> Distribution:
        """Return the distribution of Re about a nominal Re; ``spread`` must be above 0."""
        return scipy.stats.lognorm(s=self.spread, scale=nominal)


@dataclasses.dataclass(frozen=True)
class Uniform:
    """A distribution of Re: uniform between (1 - spread) and (1 + spread) times the nominal Re.

    Args:
      spread: relative half width, 0 to below 1.
    """

    spread: float

    def __post_init__(self):
        object.__setattr__(self, "spread", finite_number("spread", self.spread))
        if not 0 <= self.spread < 1:
            raise InvalidInput(f"spread {self.spread:g}: from 0 to below 1, of Re")

    def around(self, nominal: float) -> Distribution:
        """Return the distribution of Re about a nominal Re; ``spread`` must be above 0."""
        return scipy.stats.uniform(nominal * (1 - self.spread), 2 * nominal * self.spread)


def latin_hypercube(seed: int, count: int, columns: int) -> Float[np.ndarray, "count columns"]:
    """Draw ``count`` points in [0, 1)^columns, stratified in every column (McKay et al. 1979)."""
    return scipy.stats.qmc.LatinHypercube(columns, rng=seed).random(count)
