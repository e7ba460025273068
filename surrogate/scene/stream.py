"""Streams past a body: unbounded, or between the walls of a tunnel."""

import dataclasses

from surrogate.checks import finite_number
from surrogate.errors import InvalidInput


@dataclasses.dataclass(frozen=True)
class Unbounded:
    """An unbounded stream."""

    def __str__(self) -> str:
        return "unbounded"


@dataclasses.dataclass(frozen=True)
class Tunnel:
    """A channel with slip walls, ``height`` D apart, the body's centroid on its centre line."""

    height: float

    def __post_init__(self):
        height = finite_number("tunnel height", self.height)
        if not 1 < height <= 1000:
            raise InvalidInput(f"tunnel height {height:g}: above 1 and up to 1000 D")
        object.__setattr__(self, "height", height)

    def __str__(self) -> str:
        return f"tunnel:{self.height!r}"


Stream = Unbounded | Tunnel


def parse_stream(text: object) -> Stream:
    """Return the stream called 'unbounded' or 'tunnel:H', H in D.

    Raises:
      InvalidInput: it is neither.
    """
    if str(text) == "unbounded":
        return Unbounded()
    kind, _, value = str(text).partition(":")
    try:
        return Tunnel(float(value if kind == "tunnel" else ""))
    except (ValueError, InvalidInput):
        wanted = "'unbounded' or 'tunnel:H' with H above 1 and up to 1000 D"
        raise InvalidInput(f"stream {text!r}: {wanted}") from None


def domain_height(stream: Stream, usual: float) -> float:
    """Return the domain's height in D: a tunnel's where that is affordable, else the usual one."""
    spans = isinstance(stream, Tunnel) and stream.height <= 2 * usual
    return stream.height if spans else usual


def describe_stream(stream: Stream) -> str:
    """Return the stream in words."""
    if isinstance(stream, Tunnel):
        return f"a slip-walled tunnel of height {stream.height:g} D"
    return "an unbounded stream"
