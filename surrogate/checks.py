"""Checks of arguments that several public functions share."""

import contextlib
import difflib
import math
from collections.abc import Iterable
from types import UnionType

import jax
import numpy as np
from jaxtyping import Float

from surrogate.arrays import Number
from surrogate.errors import InvalidInput

SMALLEST, LARGEST = 1e-12, 1e12  # of speeds, sizes, densities and viscosities in SI units
LONGEST = 120  # characters of a refused value in a message
NOT_REAL = "bcSUmM"  # NumPy's kinds of types: bool, complex, bytes, text, time spans, dates


def real_numbers(value: object) -> Float[np.ndarray, "..."] | None:
    """Return the value as an array of floats; None if a part is traced or is not a real number."""
    try:
        typed = isinstance(getattr(value, "dtype", None), np.dtype)
        given = value if typed else np.asarray(value, object)
        parts = given.ravel() if given.dtype.kind == "O" else [given]
        if np.ma.is_masked(value) or not all(map(_is_real, parts)):
            return None
        return np.asarray(given).astype(float)
    except (TypeError, ValueError, OverflowError, AttributeError):
        return None


def _is_real(part):
    kind = np.asarray(part).dtype.kind
    return hasattr(part, "__float__") if kind == "O" else kind not in NOT_REAL


def shown(value: object) -> str:
    """Return the repr of a value in one line of limited length, for messages."""
    words = " ".join(repr(value).split())
    return words if len(words) <= LONGEST else f"{words[:LONGEST]} ..."


def did_you_mean(word: object, known: Iterable[str], alike: float = 0.6) -> str:
    """Return a hint at the known word that is most like a wrong one; empty if none is like it.

    Args:
      word: the wrong one.
      known: all that would be right.
      alike: least ratio of ``difflib`` at which a word is like another.
    """
    close = difflib.get_close_matches(str(word), known, 1, alike)
    return f"; did you mean {close[0]}?" if close else ""


def finite_number(name: str, value: object, of_several: str = "") -> float:
    """Return the value as a float if it is one finite number.

    Args:
      name: what the value is; begins the message.
      value: what is checked.
      of_several: what to do with several numbers, which ends the message if there are.

    Raises:
      InvalidInput: it is not one finite real number.
    """
    found = real_numbers(value)
    if found is None or found.ndim:
        hint = f", and these are several{of_several}" if found is not None else ""
        raise InvalidInput(f"{name} {shown(value)}: must be one number{hint}")
    number = float(found)
    if not math.isfinite(number):
        raise InvalidInput(f"{name} {number:g}: must be a finite number")
    return number


def physical_number(name: str, value: object) -> float:
    """Return a speed, size, density or viscosity in SI units as a float.

    Args:
      name: what the value is; begins the message.
      value: what is checked.

    Raises:
      InvalidInput: it is not one number from 1e-12 to 1e12.
    """
    number = finite_number(name, value)
    if not SMALLEST <= number <= LARGEST:
        raise InvalidInput(f"{name} {number:g}: from {SMALLEST:g} to {LARGEST:g}")
    return number


def one_number(name: str, value: object) -> Number:
    """Return the value as a float, or unchanged where JAX traces it.

    Raises:
      InvalidInput: it is not one real number, or not finite.
    """
    if not traced(value):
        return finite_number(name, value)
    if (shape := _shape(name, value)) != ():
        raise InvalidInput(f"{name}: an array of shape {shape}; must be one number")
    return value


def interval(name: str, value: object) -> tuple[float, float]:
    """Return the value as a range (low, high).

    Raises:
      InvalidInput: it is not two finite numbers in ascending order.
    """
    sequence = isinstance(value, list | tuple) or getattr(value, "ndim", 0) == 1
    if not sequence or len(value) != 2:
        raise InvalidInput(f"{name} {shown(value)}: must be two numbers, low and high")
    low, high = (finite_number(name, end) for end in value)
    if low > high:
        raise InvalidInput(f"{name} {low:g} to {high:g}: low must not be above high")
    return low, high


def whole_number(name: str, value: object, low: int, high: int) -> int:
    """Return the value as an integer from ``low`` to ``high``.

    Args:
      name: what the value is; begins the message.
      value: what is checked.
      low: least value allowed.
      high: greatest value allowed.

    Raises:
      InvalidInput: it is not such an integer.
    """
    number = finite_number(name, value)
    if number != round(number) or not low <= number <= high:
        raise InvalidInput(f"{name} {number:.12g}: a whole number from {low} to {high} is needed")
    return round(number)


def expect(name: str, value: object, kind: type | UnionType, wanted: str) -> None:
    """Raise InvalidInput unless the value is an instance of ``kind``.

    Args:
      name: what the value is for; begins the message.
      value: what is checked.
      kind: its expected type.
      wanted: the name of this type in the message.
    """
    if not isinstance(value, kind):
        raise InvalidInput(f"{name}: {shown(value)} is no {wanted}")


def flag(name: str, value: object) -> bool:
    """Return the value as a bool if it is True or False, of Python, NumPy or JAX.

    Args:
      name: what the value is; begins the message.
      value: what is checked.

    Raises:
      InvalidInput: it is neither.
    """
    typed = getattr(value, "dtype", None) == np.dtype(bool) and not traced(value)
    if not (isinstance(value, bool) or (typed and np.ndim(value) == 0)):
        raise InvalidInput(f"{name} {shown(value)}: must be True or False")
    return bool(value)


def one_body(parameters: object, reynolds: object, size: int) -> None:
    """Raise InvalidInput unless traced arguments are one body and one Reynolds number.

    Their shapes must be (size,) and ().
    """
    shapes = _shape("body", parameters), _shape("Reynolds number", reynolds)
    if shapes != ((size,), ()):
        raise InvalidInput(
            f"body and Reynolds number: arrays of shapes {shapes[0]} and {shapes[1]}; of shapes "
            f"({size},) and () are needed; jax.vmap takes batches here, flow.solve_all without jit"
        )


def check_batch(parameters: object, reynolds: object, size: int) -> None:
    """Raise InvalidInput unless bodies and Reynolds numbers broadcast to one drag each.

    Their shapes must be (..., size) and (...).
    """
    shapes = _shape("body", parameters), _shape("Reynolds number", reynolds)
    with contextlib.suppress(ValueError):
        if shapes[0][-1:] == (size,):
            np.broadcast_shapes(shapes[0][:-1], shapes[1])
            return
    raise InvalidInput(
        f"body and Reynolds number: arrays of shapes {shapes[0]} and {shapes[1]}; of shapes "
        f"({size},) and () are needed, or of leading axes that broadcast"
    )


def _shape(name, value):
    if isinstance(value, jax.core.Tracer):
        if getattr(value.dtype, "kind", "S") in NOT_REAL:  # a random key has a dtype without kind
            raise InvalidInput(f"{name}: traced as {value.dtype}; real numbers are needed")
        return value.shape
    if (found := real_numbers(value)) is None:
        raise InvalidInput(
            f"{name} {shown(value)}: must be numbers, in a jax.numpy array where they are traced"
        )
    return found.shape


def traced(*values: object) -> bool:
    """Return whether JAX traces one of the values."""
    return any(isinstance(value, jax.core.Tracer) for value in values)


def transformed(*values: object) -> bool:
    """Return whether JAX traces one of the values, or a function around this call.

    Public functions then answer invalid inputs by NaN, since they cannot raise an exception.
    """
    return traced(*values) or traced(jax.device_put(0.0))
