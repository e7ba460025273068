"""What is modelled: stream, Reynolds range, bodies, fidelity. Nothing else is built."""

import dataclasses
import math

import numpy as np

from surrogate.body import Family
from surrogate.errors import InvalidInput

LONGEST_WINDOW = 40.0  # downstream, in D
ONSET_OF_SHEDDING = 46.7  # cylinder, unbounded stream


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
    """Resolution: ``cells`` per D, the window's reach in D, harmonics of the traction.

    ``promise`` is the relative error of the drag that it is made for (Re 0.5 to 45, aspect 0.5 to
    5), ``wake`` how much window a wake takes: reach downstream in D per Re (height / D)^2.
    """

    name: str
    cells: int
    upstream: float
    downstream: float
    height: float
    harmonics: int = 7
    wake: float = 0.2
    promise: float = 0.015

    def reaching(self, reynolds: float, height: float) -> "Fidelity":
        """The same for bodies of this height at up to this Re: bluff ones need a longer window."""
        missing = min(self.wake * reynolds * height**2, LONGEST_WINDOW) - self.downstream
        if missing <= 2:
            return self
        longer = self.downstream + 8 * math.ceil(missing / 8)
        return dataclasses.replace(self, downstream=longer, height=self.height + 4)

    def coarser(self) -> "Fidelity":
        """Two thirds of the cells."""
        return dataclasses.replace(self, cells=round(2 * self.cells / 3))

    def smaller(self) -> "Fidelity":
        """Two thirds of the window."""
        return dataclasses.replace(
            self,
            upstream=2 * self.upstream / 3,
            downstream=2 * self.downstream / 3,
            height=2 * self.height / 3,
        )


FIDELITIES = {
    level.name: level
    for level in (
        Fidelity("draft", 10, 4, 8, 8, wake=0.15, promise=0.015),
        Fidelity("standard", 16, 6, 12, 8, wake=0.2, promise=0.004),
        Fidelity("fine", 32, 8, 20, 12, wake=0.3, promise=0.001),
    )
}


@dataclasses.dataclass(frozen=True)
class Scene:
    """A family of bodies in a stream over a range of Reynolds numbers."""

    stream: Stream = Unbounded()
    reynolds: tuple[float, float] = (1.0, 40.0)
    family: Family = Family()
    fidelity: Fidelity = FIDELITIES["standard"]

    def explain(self) -> str:
        """What was chosen and why, what is left out, and what one solve costs."""
        f = self.fidelity
        cells = round((f.upstream + f.downstream) * f.cells) * round(f.height * f.cells) // 2
        where = (
            "an unbounded stream"
            if self.stream == Unbounded()
            else (f"a slip-walled tunnel of height {self.stream.height:g} D")
        )
        return "\n".join(
            [
                f"Steady laminar flow in {where}, Re {self.reynolds[0]:g} to {self.reynolds[1]:g}.",
                f"Bodies: symmetric family, area pi/4, {_bounds(self.family)}.",
                f"Grid ({f.name}): {f.cells} cells per D on a window "
                f"{f.upstream + f.downstream:g} x {f.height:g} D ({cells} cells in its "
                "upper half), where the flow is non-linear; outside it the "
                "Oseen Green's function and the far field's momentum flux are exact to F^2. Made "
                f"for drags within {100 * f.promise:g} % over Re 0.5 to 45 and aspect 0.5 to 5; "
                "longer wakes get a longer window.",
                f"Traction: {2 * f.harmonics + 1} modes.",
                "One body flow costs about 30 to 60 applications of G, its shape gradient 5 to 20.",
                "Left out: the third dimension, unsteadiness (bluff bodies shed vortices beyond "
                f"Re {ONSET_OF_SHEDDING:g}), compressibility, roughness.",
            ]
        )


def check_stream(stream: Stream, fidelity: Fidelity, reach: np.ndarray) -> None:
    """Raise InvalidInput unless a body of this reach (length, height) fits window and stream."""
    half = reach[0] / 2 + 1.5
    if half > fidelity.upstream or reach[1] / 2 + 1.25 > fidelity.height / 2:
        raise InvalidInput(
            f"body: {reach[0]:g} x {reach[1]:g} D is too large for the {fidelity.name} window; "
            "fine reaches further, and bodies are best scaled to area pi/4"
        )
    if isinstance(stream, Tunnel) and stream.height < reach[1] + 1:
        raise InvalidInput(
            f"tunnel:{stream.height:g} leaves less than half a diameter beside a body {reach[1]:g} "
            f"D high; a height above {reach[1] + 1:g} would do"
        )


def parse_stream(text: str) -> Stream:
    """'unbounded' or 'tunnel:H' with H in D."""
    if text == "unbounded":
        return Unbounded()
    kind, _, value = text.partition(":")
    try:
        height = float(value)
    except ValueError:
        height = math.nan
    if kind != "tunnel" or not 1 < height <= 1000:
        raise InvalidInput(f"stream {text!r}: 'unbounded' or 'tunnel:H' with H from 1 to 1000 D")
    return Tunnel(height)


def check_reynolds(reynolds: float, allow_unsteady: bool = False) -> None:
    """Raise InvalidInput unless a steady laminar flow is a fair answer at this Re."""
    if not (math.isfinite(reynolds) and reynolds > 0):
        raise InvalidInput(f"Reynolds number {reynolds:g}: must be a finite number above 0")
    if reynolds < 1e-3:
        raise InvalidInput(f"Reynolds number {reynolds:g}: the solver is tested from 0.001")
    if reynolds > 300:
        raise InvalidInput(f"Reynolds number {reynolds:g}: the steady solver is tested up to 300")
    if reynolds > ONSET_OF_SHEDDING and not allow_unsteady:
        raise InvalidInput(
            f"Reynolds number {reynolds:g}: bluff bodies shed vortices beyond "
            f"{ONSET_OF_SHEDDING:g}, so the steady drag is not what nature does; "
            "--allow-unsteady asks for it all the same"
        )


def _bounds(family):
    return ", ".join(
        f"{field.name} {low:g} to {high:g}"
        for field in dataclasses.fields(family)
        for low, high in [getattr(family, field.name)]
    )
