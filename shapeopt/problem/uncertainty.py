"""Distributions of an uncertain Reynolds number, and even draws from one seed."""

import dataclasses
import math

import jax
import numpy as np
from jaxtyping import Float
from scipy.special import ndtr, ndtri

from surrogate.errors import InvalidInput


@dataclasses.dataclass(frozen=True)
class LogNormal:
    """log Re is normal about the log of the nominal Re, with standard deviation ``spread``."""

    spread: float

    def __post_init__(self):
        if not 0 <= self.spread <= 2:
            raise InvalidInput(f"spread {self.spread:g}: from 0 to 2, of log Re")

    def below(self, reynolds: float, nominal: float) -> float:
        """Probability of a smaller Re."""
        return float(ndtr(math.log(reynolds / nominal) / max(self.spread, 1e-12)))

    def quantile(
        self, probability: Float[np.ndarray, " cases"], nominal: float
    ) -> Float[np.ndarray, " cases"]:
        return nominal * np.exp(self.spread * ndtri(probability))


@dataclasses.dataclass(frozen=True)
class Uniform:
    """Re is uniform within the relative ``spread`` on both sides of the nominal Re."""

    spread: float

    def __post_init__(self):
        if not 0 <= self.spread < 1:
            raise InvalidInput(f"spread {self.spread:g}: from 0 to below 1, of Re")

    def below(self, reynolds: float, nominal: float) -> float:
        """Probability of a smaller Re."""
        place = (reynolds / nominal - 1) / max(self.spread, 1e-12)
        return float(np.clip((place + 1) / 2, 0, 1))

    def quantile(
        self, probability: Float[np.ndarray, " cases"], nominal: float
    ) -> Float[np.ndarray, " cases"]:
        return nominal * (1 + self.spread * (2 * probability - 1))


def latin_hypercube(seed: int, count: int, columns: int) -> Float[np.ndarray, "count columns"]:
    """Uniform in [0, 1), one draw in every count-th part of every column."""

    def column(key):
        place, inside = jax.random.split(key)
        draws = jax.random.uniform(inside, (count,), float)
        return (jax.random.permutation(place, count) + draws) / count

    keys = jax.random.split(jax.random.key(seed), columns)
    return np.stack([np.asarray(column(key)) for key in keys], axis=1)
