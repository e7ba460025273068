"""Checks at the door that all rooms share: is it a number, is it traced, is it one body."""

import math
from typing import Any

import jax
import numpy as np

from surrogate.errors import InvalidInput


def finite_number(name: str, value: Any) -> float:
    """Any kind of number as a float.

    Raises:
      InvalidInput: it is text, an array, complex or not finite.
    """
    strange = str | bytes | bool | np.bool_ | np.ma.MaskedArray | None
    try:
        if isinstance(value, strange) or np.ndim(value) or np.iscomplexobj(value):
            raise InvalidInput(f"{name} {value!r}: must be one number")
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidInput(f"{name} {value!r}: must be one number") from None
    if not math.isfinite(number):
        raise InvalidInput(f"{name} {number:g}: must be a finite number")
    return number


def interval(name: str, value: Any) -> tuple[float, float]:
    """A range (low, high) of two finite numbers in order.

    Raises:
      InvalidInput: it is anything else.
    """
    if not isinstance(value, list | tuple | np.ndarray | jax.Array) or len(value) != 2:
        raise InvalidInput(f"{name} {value!r}: must be two numbers, low and high")
    low, high = (finite_number(name, end) for end in value)
    if low > high:
        raise InvalidInput(f"{name} {low:g} to {high:g}: low must not be above high")
    return low, high


def whole_number(name: str, value: Any, low: int, high: int) -> int:
    """A whole number from ``low`` to ``high``.

    Raises:
      InvalidInput: it is anything else.
    """
    number = finite_number(name, value)
    if number != round(number) or not low <= number <= high:
        raise InvalidInput(f"{name} {value}: a whole number from {low} to {high} is needed")
    return round(number)


def expect(name: str, value: Any, kind: Any, wanted: str) -> None:
    """Raise InvalidInput, saying what is ``wanted``, unless the value is of this kind."""
    if not isinstance(value, kind):
        raise InvalidInput(f"{name}: {value!r} is no {wanted}")


def one_body(parameters: Any, reynolds: Any, size: int) -> None:
    """Raise InvalidInput unless what JAX traces is one body of so many parameters and one Re."""
    shapes = np.shape(parameters), np.shape(reynolds)
    if shapes != ((size,), ()):
        raise InvalidInput(
            f"body and Reynolds number: arrays of shapes {shapes[0]} and {shapes[1]}; of shapes "
            f"({size},) and () are needed, and jax.vmap takes batches"
        )


def traced(*values: Any) -> bool:
    """Whether JAX is tracing: then there are no numbers to check, and answers turn NaN instead."""
    return any(isinstance(value, jax.core.Tracer) for value in values)
