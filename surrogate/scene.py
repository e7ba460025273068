"""What is modelled: stream, Reynolds range, fidelity. Nothing else is built."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Unbounded:
    """A stream without walls."""


@dataclasses.dataclass(frozen=True)
class Tunnel:
    """A channel with slip walls, ``height`` in D, the body's centroid on its centre line."""

    height: float


Stream = Unbounded | Tunnel


@dataclasses.dataclass(frozen=True)
class Fidelity:
    """Resolution: ``cells`` per D, the window's reach in D, harmonics of the traction."""

    name: str
    cells: int
    upstream: float
    downstream: float
    height: float
    harmonics: int = 7


DRAFT = Fidelity("draft", 8, 4, 8, 8)
STANDARD = Fidelity("standard", 12, 4, 12, 8)
FINE = Fidelity("fine", 16, 8, 16, 12)
