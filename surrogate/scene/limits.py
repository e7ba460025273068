"""What can be asked: Reynolds numbers that are steady and tested, bodies that fit their stream."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from surrogate.checks import finite_number
from surrogate.errors import InvalidInput
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.stream import Stream, Tunnel

REYNOLDS = {2: (1e-3, 300.0), 3: (1e-3, 300.0)}  # that the steady solver is tested for
ONSET_OF_SHEDDING = {2: 46.7, 3: 210.0}  # cylinder, sphere, in an unbounded stream
STUBBY = 0.9  # power of length over width that the onset goes with, of bodies wider than long


def onset_of_shedding(reach: Any) -> Any:
    """Re from which a body of this reach, (length, ...) in D, may have no steady symmetric wake.

    In space discs lose theirs well before spheres do; ``scripts/measure/onset.py`` has it.
    """
    onset = ONSET_OF_SHEDDING[len(reach)]
    if len(reach) == 2:
        return onset
    return onset * jnp.minimum(reach[0] / jnp.maximum(reach[1], reach[2]), 1.0) ** STUBBY


def check_reynolds(
    reynolds: Any, allow_unsteady: bool = False, dimension: int = 2, reach: Any = None
) -> float:
    """A Reynolds number at which a steady laminar flow is a fair answer, of a body of this reach.

    Raises:
      InvalidInput: it is none, is beyond what the solver is tested for, or bodies shed vortices
        there and ``allow_unsteady`` is not set.
    """
    value = finite_number("Reynolds number", reynolds)
    if value <= 0:
        raise InvalidInput(f"Reynolds number {value:g}: must be a finite number above 0")
    (low, high), onset = REYNOLDS[dimension], ONSET_OF_SHEDDING[dimension]
    onset = onset if reach is None else float(onset_of_shedding(reach))
    if value < low:
        raise InvalidInput(f"Reynolds number {value:g}: the solver is tested from {low:g}")
    if value > high:
        raise InvalidInput(f"Reynolds number {value:g}: the steady solver is tested up to {high:g}")
    if value > onset and not allow_unsteady:
        raise InvalidInput(
            f"Reynolds number {value:g}: bluff bodies shed vortices beyond "
            f"{onset:.3g}, so the steady drag is not what nature does; "
            "allow_unsteady (--allow-unsteady) asks for it all the same"
        )
    return value


def check_stream(
    stream: Stream, fidelity: Fidelity, reach: np.ndarray, room: tuple[float, float]
) -> None:
    """Raise InvalidInput unless a body of this reach, (length, ..., height), fits the stream.

    ``room`` is what must lie between it and the window's edges, in D; accuracy asks for a lot.
    """
    along, across = reach[0] / 2 + room[0], np.max(reach[1:]) / 2 + room[1]
    if along > fidelity.upstream or across > fidelity.height / 2:
        sides = " x ".join(f"{side:g}" for side in reach)
        raise InvalidInput(
            f"body: {sides} D is too large for the {fidelity.name} window; "
            "fine reaches further, and bodies are best scaled to an equivalent diameter of 1"
        )
    if isinstance(stream, Tunnel) and stream.height < reach[1] + 1:
        raise InvalidInput(
            f"tunnel:{stream.height:g} leaves less than half a diameter beside a body {reach[1]:g} "
            f"D high; a height above {reach[1] + 1:g} would do"
        )
