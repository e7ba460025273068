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
    if isinstance(value, str | bytes | bool | None) or np.ndim(value) or np.iscomplexobj(value):
        raise InvalidInput(f"{name} {value!r}: must be one number")
    try:
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
    if isinstance(value, str) or np.ndim(value) != 1 or len(value) != 2:
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


def traced(*values: Any) -> bool:
    """Whether JAX is tracing: then there are no numbers to check, and answers turn NaN instead."""
    return any(isinstance(value, jax.core.Tracer) for value in values)
