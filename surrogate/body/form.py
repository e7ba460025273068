"""What the numbers of a body mean: the names of its parameters, in the plane or in space."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.errors import InvalidInput

PARAMETERS = ("aspect", "flatness", *(f"beta{k}" for k in range(2, 13)))
RATIOS = ("aspect", "flatness")  # whose logarithms the drag varies smoothly with


def check_dimension(value: Any) -> int:
    """2 or 3.

    Raises:
      InvalidInput: it is anything else.
    """
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float | np.number)
        or value not in (2, 3)
    ):
        raise InvalidInput(f"dimension {value!r}: 2, in the plane, or 3, in space")
    return int(value)


@dataclasses.dataclass(frozen=True)
class Form:
    """Names of the parameters in their order, the aspect first, and the dimension of the body."""

    names: tuple[str, ...]
    dimension: int = 2

    @property
    def ratios(self) -> int:
        """How many of the parameters are ratios of lengths; betas are behind them."""
        return sum(name in RATIOS for name in self.names)

    @property
    def modes(self) -> tuple[int, ...]:
        """Sine modes that the betas weigh."""
        return tuple(int(name.removeprefix("beta")) for name in self.names[self.ratios :])

    def aspect(self, parameters: Float[AnyArray, " parameters"]) -> Float[Array, ""]:
        return jnp.asarray(parameters[0])

    def flatness(self, parameters: Float[AnyArray, " parameters"]) -> Float[Array, ""]:
        """Width over height; 1 where it is no parameter."""
        return jnp.asarray(parameters[1]) if self.ratios == 2 else jnp.ones(())

    def betas(self, parameters: Float[AnyArray, " parameters"]) -> Float[Array, " betas"]:
        return jnp.asarray(parameters)[self.ratios :]

    def smooth(self, parameters: Float[AnyArray, " parameters"]) -> Float[Array, " parameters"]:
        """Coordinates in which the drag varies smoothly: ratios count by their logs."""
        values = jnp.asarray(parameters)
        ratios = values[: self.ratios]
        return values.at[: self.ratios].set(jnp.log(ratios))
