"""Random 2-D bodies and Reynolds numbers, inside and around the range of the error tolerance."""

import math
from collections.abc import Iterator

import numpy as np
from scipy.stats import qmc
from study import Row

from surrogate import InvalidInput, Shape, contour_shape, family_shape

KINDS = ("symmetric", "incidence", "general", "tunnel")
ASPECT, REYNOLDS = (0.4, 6.0), (0.25, 60.0)  # the error tolerance is for 0.5 to 5 and 0.5 to 45
BETAS = {"beta2": 0.3, "beta3": 0.2, "beta4": 0.12}  # at most
INCIDENCE = 15.0  # degrees, at most
TUNNELS = (4.0, 8.0, 16.0)
WAVES = np.arange(2, 6)  # of a general body's radius
WAVY = 0.3  # amplitude of wave k, at most, times k


def random_bodies(count: int, seed: int) -> Iterator[Row]:
    """Yield ``count`` random bodies with their Re and stream, as many of every kind.

    Re and aspect are drawn evenly in their logarithms, the rest evenly.
    """
    draws = qmc.Sobol(2 + 2 * len(WAVES) + 1, rng=seed).random_base2(math.ceil(math.log2(count)))
    for k, (re, aspect, choice, *rest) in enumerate(draws[:count]):
        reynolds = float(REYNOLDS[0] * (REYNOLDS[1] / REYNOLDS[0]) ** re)
        aspect, signs = ASPECT[0] * (ASPECT[1] / ASPECT[0]) ** aspect, 2 * np.array(rest) - 1
        kind, stream = KINDS[k * len(KINDS) // count], "unbounded"
        if kind == "general":
            shape = contour_shape(wavy(aspect, *signs.reshape(2, -1)))
        else:
            turn = INCIDENCE * (2 * choice - 1) if kind == "incidence" else 0.0
            shape = valid(aspect, signs[: len(BETAS)] * [*BETAS.values()], turn)
        if kind == "tunnel":
            stream = f"tunnel:{TUNNELS[int(choice * len(TUNNELS))]:g}"
        yield {"kind": kind, "reynolds": reynolds, "stream": stream, "shape": shape}


def valid(aspect: float, betas: np.ndarray, turn: float) -> Shape:
    """Return a body of the family, its betas halved until it does not cross itself."""
    try:
        return family_shape({"aspect": aspect} | dict(zip(BETAS, betas, strict=True)), turn)
    except InvalidInput:
        return valid(aspect, betas / 2, turn)


def wavy(aspect: float, cosines: np.ndarray, sines: np.ndarray) -> np.ndarray:
    """Return a lopsided smooth contour: an ellipse whose radius is multiplied by a random wave."""
    t = 2 * np.pi * np.arange(200) / 200
    size = WAVY / WAVES / len(WAVES)
    radius = 1 + (size * cosines) @ np.cos(np.outer(WAVES, t))
    radius += (size * sines) @ np.sin(np.outer(WAVES, t))
    return (radius * [aspect**0.5 * np.cos(t), aspect**-0.5 * np.sin(t)]).T
