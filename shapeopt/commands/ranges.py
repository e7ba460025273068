"""Numbers on the command line, as lists and ranges: 1,10,40 or 1:40:20 or 1:40:log20."""

import math
from collections.abc import Sequence

import numpy as np

from surrogate.errors import InvalidInput

MOST = 1000  # numbers of one range
RANGES = "1:40:20 (20 evenly spaced) or 1:40:log20 (logarithmically)"


def numbers(
    text: str,
    name: str = "--reynolds",
    example: str = "1,10,40",
    ranges: str = RANGES,
    logarithmic: bool = True,
) -> list[float]:
    """Parse comma-separated numbers and ranges FIRST:LAST:COUNT or FIRST:LAST:logCOUNT.

    Args:
      text: as '1,10,40' or '1:40:log20'; a range has both of its ends.
      name: of the option, which begins messages.
      example: a list, for messages.
      ranges: examples of ranges, for messages.
      logarithmic: whether numbers may be spaced logarithmically.

    Raises:
      InvalidInput: a word is neither a number nor a range, or there is none.
    """
    words = [word.split(":") for word in text.split(",")]
    if short := [":".join(parts) for parts in words if len(parts) == 2]:
        raise InvalidInput(f"{name} {text!r}: {short[0]} lacks the count of a range, as {ranges}")
    try:
        values = [v for parts in words for v in _values(parts, f"{name} {text!r}", logarithmic)]
    except ValueError as error:
        if isinstance(error, InvalidInput):
            raise
        values = []
    if not values:
        raise InvalidInput(
            f"{name} {text!r}: one number, or several with commas, as {example}, or a range, as "
            f"{ranges}"
        )
    return values


def few_numbers(text: str, name: str, form: str, *counts: int) -> list[float]:
    """Parse as many comma-separated numbers as an option takes.

    Args:
      text: as '0.3,0.001,1.2'.
      name: of the option, which begins messages.
      form: what the numbers are, for messages.
      counts: how many there may be.

    Raises:
      InvalidInput: a word is no number, or there are more or fewer.
    """
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in counts:
        raise InvalidInput(f"{name} {text!r}: {form}")
    return values


def _values(parts: Sequence[str], given: str, logarithmic: bool) -> list[float]:
    """Return the numbers of one word; raise ValueError if it is none."""
    if len(parts) == 1:
        return [float(parts[0])]
    first, last, count = parts
    count, ends = count.strip(), (float(first), float(last))
    log = count.startswith("log")
    size = int(count.removeprefix("log"))
    if log and not logarithmic:
        raise InvalidInput(f"{given}: cannot be spaced logarithmically; write a plain count")
    if not (math.isfinite(ends[0]) and math.isfinite(ends[1])):
        raise InvalidInput(f"{given}: both ends of a range must be finite")
    if not 2 <= size <= MOST:
        raise InvalidInput(f"{given}: a range has from 2 to {MOST} numbers, not {size}")
    if log and min(ends) <= 0:
        raise InvalidInput(f"{given}: both ends of a logarithmic range must be above 0")
    return (np.geomspace if log else np.linspace)(*ends, size).tolist()
