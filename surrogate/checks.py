"""Checks at the door that all rooms share: is it a number, is it traced, is it one body."""

import math
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from surrogate.errors import InvalidInput

LONGEST = 120  # letters of what is refused
NO_NUMBERS = "bcSUmM"  # kinds of NumPy's types: truth values, complex, text, dates


def real_numbers(value: Any) -> Float[np.ndarray, "..."] | None:
    """Numbers of every kind as floats; None where one is none, is masked, or is being traced."""
    try:
        given = value if isinstance(_dtype(value), np.dtype) else np.asarray(value, object)
        parts = given.ravel() if given.dtype.kind == "O" else [given]
        if np.ma.is_masked(value) or not all(map(_real, parts)):
            return None
        return np.asarray(given).astype(float)
    except (TypeError, ValueError, OverflowError, AttributeError):
        return None


def _real(part):
    kind = np.asarray(part).dtype.kind
    return hasattr(part, "__float__") if kind == "O" else kind not in NO_NUMBERS


def _dtype(value):
    return getattr(value, "dtype", None)


def shown(value: Any) -> str:
    """What came in, in one line that is not too long."""
    words = " ".join(repr(value).split())
    return words if len(words) <= LONGEST else f"{words[:LONGEST]} ..."


def finite_number(name: str, value: Any) -> float:
    """Any kind of number as a float.

    Raises:
      InvalidInput: it is text, an array, complex or not finite.
    """
    found = real_numbers(value)
    if found is None or found.ndim:
        raise InvalidInput(f"{name} {shown(value)}: must be one number")
    number = float(found)
    if not math.isfinite(number):
        raise InvalidInput(f"{name} {number:g}: must be a finite number")
    return number


def interval(name: str, value: Any) -> tuple[float, float]:
    """A range (low, high) of two finite numbers in order.

    Raises:
      InvalidInput: it is anything else.
    """
    several = isinstance(value, list | tuple) or getattr(value, "ndim", 0) == 1
    if not several or len(value) != 2:
        raise InvalidInput(f"{name} {shown(value)}: must be two numbers, low and high")
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
        raise InvalidInput(f"{name}: {shown(value)} is no {wanted}")


def one_body(parameters: Any, reynolds: Any, size: int) -> None:
    """Raise InvalidInput unless what JAX traces is one body of so many parameters and one Re."""
    shapes = _shape("body", parameters), _shape("Reynolds number", reynolds)
    if shapes != ((size,), ()):
        raise InvalidInput(
            f"body and Reynolds number: arrays of shapes {shapes[0]} and {shapes[1]}; of shapes "
            f"({size},) and () are needed, and jax.vmap takes batches"
        )


def _shape(name, value):
    """Of real numbers, traced or not."""
    if isinstance(value, jax.core.Tracer):
        if getattr(value.dtype, "kind", "S") in NO_NUMBERS:  # keys have a type of their own
            raise InvalidInput(f"{name}: traced as {value.dtype}; real numbers are needed")
        return value.shape
    if (found := real_numbers(value)) is None:
        raise InvalidInput(
            f"{name} {shown(value)}: must be numbers, in an array where they are traced"
        )
    return found.shape


def traced(*values: Any) -> bool:
    """Whether JAX is tracing: then there are no numbers to check, and answers turn NaN instead."""
    return any(isinstance(value, jax.core.Tracer) for value in values)
