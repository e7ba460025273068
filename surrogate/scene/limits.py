"""What can be asked: Reynolds numbers that are steady and tested, bodies that fit their stream."""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray, Number
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.stream import Stream, Tunnel

REYNOLDS = {2: (1e-3, 300.0), 3: (1e-3, 300.0)}  # that the steady solver is tested for
ONSET_OF_SHEDDING = {2: 46.7, 3: 210.0}  # cylinder, sphere, in an unbounded stream
# The onset goes with these powers of length over width, for bodies wider than long. By linear
# stability: in 2-D the ellipse of aspect 0.5 sheds from Re 26.7; in 3-D study ``onset``.
ONSET_POWERS = {2: math.log(46.7 / 26.7) / math.log(2), 3: 0.9}
ROUNDING = 1e-9  # relative, of a limit


def onset_of_shedding(extent: Float[AnyArray, " axes"]) -> Float[Array, ""]:
    """Return the Re from which a body of this extent may have no steady symmetric wake.

    Slender bodies have one for longer than the cylinder or the sphere, whose onset stands for
    theirs.

    Args:
      extent: length, (in 3-D width,) and height, all in D or all halved.
    """
    dimension = len(extent)
    slenderness = extent[0] / jnp.max(jnp.asarray(extent[1:]))
    return ONSET_OF_SHEDDING[dimension] * jnp.minimum(slenderness, 1.0) ** ONSET_POWERS[dimension]


def check_reynolds(
    reynolds: Number,
    allow_unsteady: bool = False,
    dimension: int = 2,
    extent: Float[AnyArray, " axes"] | None = None,
) -> float:
    """Return the Reynolds number as a float, if a steady laminar flow is a fair answer there.

    Args:
      reynolds: U D / nu.
      allow_unsteady: accept it beyond the onset of vortex shedding too.
      dimension: 2 or 3.
      extent: of the body, as in ``onset_of_shedding``; by default the cylinder or the sphere.

    Raises:
      InvalidInput: it is not a number, is beyond what the solver is tested for, or the body sheds
        vortices there and ``allow_unsteady`` is not set.
    """
    value = finite_number("Reynolds number", reynolds)
    if value <= 0:
        raise InvalidInput(f"Reynolds number {value:g}: must be a finite number above 0")
    (low, high), onset = REYNOLDS[dimension], ONSET_OF_SHEDDING[dimension]
    onset = onset if extent is None else float(onset_of_shedding(extent))
    if value < low * (1 - ROUNDING):
        raise InvalidInput(f"Reynolds number {value:g}: the solver is tested from {low:g}")
    if value > high * (1 + ROUNDING):
        raise InvalidInput(f"Reynolds number {value:g}: the steady solver is tested up to {high:g}")
    if value > onset * (1 + ROUNDING) and not allow_unsteady:
        raise InvalidInput(
            f"Reynolds number {value:g}: bluff bodies shed vortices beyond "
            f"{onset:.3g}, so no steady flow is observed there; "
            "allow_unsteady (--allow-unsteady) asks for it all the same"
        )
    return value


def check_stream(
    stream: Stream,
    fidelity: Fidelity,
    extent: Float[np.ndarray, " axes"],
    clearance: tuple[float, float],
) -> None:
    """Raise InvalidInput unless a body fits the window and, if there is one, the tunnel.

    Args:
      stream: in which the body is.
      fidelity: whose window it must fit.
      extent: sides in D of a box around the body as it lies: length, ..., height.
      clearance: D that accuracy needs between this box and the window's edges, along and across.
    """
    along, across = extent[0] / 2 + clearance[0], np.max(extent[1:]) / 2 + clearance[1]
    if along > fidelity.upstream or across > fidelity.height / 2:
        sides = " x ".join(f"{side:g}" for side in extent)
        raise InvalidInput(
            f"body: {sides} D is too large for the {fidelity.name} window; "
            "fine has a larger one, and bodies are best scaled to an equivalent diameter of 1"
        )
    if isinstance(stream, Tunnel) and stream.height < extent[1] + 1:
        raise InvalidInput(
            f"tunnel:{stream.height:g} leaves less than half a diameter above and below a box "
            f"{extent[1]:g} D high around the body as it lies; tunnel:{extent[1] + 1:g} would do"
        )
