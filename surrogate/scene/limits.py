"""What can be asked: Reynolds numbers that are steady and tested, bodies that fit their stream."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray, Number
from surrogate.body.measures import streamwise_profile
from surrogate.body.shape import NODES, Shape
from surrogate.checks import finite_number
from surrogate.errors import InvalidInput, TooLarge
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.stream import Stream, Tunnel

REYNOLDS = {2: (1e-3, 350.0), 3: (1e-3, 300.0)}  # that the steady solver is tested for
# Re above which the steady flow past a cylinder, a sphere is unstable, in an unbounded stream. The
# cylinder then sheds vortices; the sphere's wake loses its symmetry and sheds beyond about 270.
ONSET_OF_INSTABILITY = {2: 46.7, 3: 210.0}
ROUNDING = 1e-9  # relative, of a limit


class OnsetRule2D(NamedTuple):
    """Constants of a rule for the Reynolds number at which vortex shedding begins in 2-D.

        Re = sqrt(plate^2 + slope^2 (length / height)^power) / height
        height^2 = H^2 + (lean rise^2 + cross rise arch + bend arch^2) L / H

    Of a body as it lies in the stream, see ``StreamwiseProfile``: L and H are its length and
    height; length is L, times front^nose if the front half is less full than an ellipse's.

    Attributes:
      plate: onset, by the height, of a plate across the stream, extrapolated from aspect 0.3.
      slope: about what slenderness adds to the onset by the height.
      power: of the slenderness.
      lean: weight of the rise of the mean line, mostly by incidence.
      cross: weight of rise and arch together: camber in the sense of the incidence adds to it.
      bend: weight of the arch of the mean line, mostly by camber.
      nose: power of the fullness of the front half.
    """

    plate: float
    slope: float
    power: float
    lean: float
    cross: float
    bend: float
    nose: float

    def by_height(self, slenderness: Float[AnyArray, ""]) -> Float[Array, ""]:
        """Return the onset as a Reynolds number by the height, for this ratio length / height."""
        return jnp.sqrt(self.plate**2 + self.slope**2 * slenderness**self.power)


class OnsetRule3D(NamedTuple):
    """Constants of a rule for the onset of instability of a 3-D body as it lies in the stream.

    With n and w, the narrower and the broader one of height and width, and the slenderness
    s = (length / n) min(rear, 1)^tail / (1 + (height / thickness - 1)^3), see
    ``StreamwiseProfile``,

        Re = (R2 + (R3 - R2) (n / w)^power) / n,    R3 = sqrt(plate^2 + (slope s)^2),

    where R2 is that of a cylinder of the same slenderness by its height (``OnsetRule2D``). The flow
    past slender bodies is stable for longer than that past the sphere, whose onset is the limit.

    Attributes:
      plate: R3 of slenderness 0, extrapolated; a thin disc across the stream has 115.
      slope: about what slenderness adds to it.
      power: of the ratio of the sides across the stream.
      tail: power of the fullness of the rear half, where that is less full than an ellipse's.
      most_inclined: height / thickness up to which bodies at incidence were searched; the rule
        takes more inclined ones for those of this ratio.
    """

    plate: float
    slope: float
    power: float
    tail: float
    most_inclined: float


# Fitted to the studies ``onset`` and ``onset_incidence``, and to ``onset_2d``: plate, slope and
# power to its first 20 bodies, with an earlier form of the rule; the others to all that it calls
# fitted, by least squares of the logarithm.
RULE_3D = OnsetRule3D(126.5, 170.0, 0.4, 0.84, 1.9)
RULE_2D = OnsetRule2D(34.9, 31.3, 2.21, 0.119, 0.283, 0.469, 0.281)


@jax.jit
def onset_of_instability(
    extent: Float[AnyArray, " axes"], contour: Float[AnyArray, "nodes 2"]
) -> Float[Array, ""]:
    """Return an estimate of the Re above which the steady flow past a body is unstable.

    The rules are fitted to linear stability by finite elements in an unbounded stream; the effect
    of tunnel walls is left out.

    Args:
      extent: length, (in 3-D width,) and height in D, each twice the farthest from the centroid.
      contour: of the body as it lies in the stream, in 3-D of its section by the plane of symmetry.
    """
    return onset_in_2d(contour) if len(extent) == 2 else onset_in_3d(extent, contour)


def onset_in_3d(
    extent: Float[AnyArray, " axes"], contour: Float[AnyArray, "nodes 2"]
) -> Float[Array, ""]:
    """Return the onset of instability of a 3-D body by ``OnsetRule3D``.

    Args:
      extent: length, width and height in D, each twice the farthest from the centroid.
      contour: of the section by the plane of symmetry, as it lies in the stream.
    """
    length, height, thickness, *_, rear = streamwise_profile(contour)
    narrow, broad = jnp.minimum(extent[1], height), jnp.maximum(extent[1], height)
    inclination = jnp.minimum(height / thickness, RULE_3D.most_inclined) - 1
    slenderness = length / narrow * jnp.minimum(rear, 1.0) ** RULE_3D.tail / (1 + inclination**3)
    compact = jnp.hypot(RULE_3D.plate, RULE_3D.slope * slenderness)
    long = RULE_2D.by_height(slenderness)
    onset = (long + (compact - long) * (narrow / broad) ** RULE_3D.power) / narrow
    return jnp.minimum(onset, ONSET_OF_INSTABILITY[3])


def onset_in_2d(contour: Float[AnyArray, "nodes 2"]) -> Float[Array, ""]:
    """Return the onset of shedding of a 2-D body with this contour as it lies in the stream."""
    length, height, _, rise, arch, front, _ = streamwise_profile(contour)
    wake = RULE_2D.lean * rise**2 + RULE_2D.cross * rise * arch + RULE_2D.bend * arch**2
    height = jnp.sqrt(height**2 + wake * length / height)
    slenderness = length * jnp.minimum(front, 1.0) ** RULE_2D.nose / height
    return RULE_2D.by_height(slenderness) / height


def onset_of(shape: Shape) -> float:
    """Return ``onset_of_instability`` of a body, as a float."""
    return float(onset_of_instability(shape.extent, shape.draw(NODES)))


def check_reynolds(reynolds: Number, dimension: int = 2, onset: float = math.inf) -> float:
    """Check that a steady laminar flow is a fair answer at a Reynolds number; return it as a float.

    Args:
      reynolds: U D / nu.
      dimension: 2 or 3.
      onset: of instability of the body, see ``onset_of``; infinite to accept unsteady flows too.

    Raises:
      InvalidInput: it is not a number, is beyond what the solver is tested for, or is beyond the
        onset of instability.
    """
    many = "; a loop, flow.solve_all and net.drag take many"
    value = finite_number("Reynolds number", reynolds, of_several=many)
    if value <= 0:
        raise InvalidInput(f"Reynolds number {value:g}: must be a finite number above 0")
    low, high = REYNOLDS[dimension]
    if value < low * (1 - ROUNDING):
        raise InvalidInput(f"Reynolds number {value:g}: the solver is tested from {low:g}")
    if value > high * (1 + ROUNDING):
        raise InvalidInput(f"Reynolds number {value:g}: the steady solver is tested up to {high:g}")
    if value > onset * (1 + ROUNDING):
        raise InvalidInput(
            f"Reynolds number {value:g}: the steady flow past such a body is unstable beyond "
            f"{onset:.3g} and not observed there; "
            "allow_unsteady (--allow-unsteady) asks for it all the same"
        )
    return value


def check_stream(
    stream: Stream,
    fidelity: Fidelity,
    extent: Float[np.ndarray, " axes"],
    clearance: tuple[float, float],
) -> None:
    """Check that a body fits the domain and, if there is one, the tunnel.

    Args:
      stream: in which the body is.
      fidelity: whose domain it must fit.
      extent: sides in D of a box around the body as it lies: length, ..., height.
      clearance: D that accuracy needs between this box and the domain's edges, along and across.

    Raises:
      TooLarge: the body does not fit the domain.
      InvalidInput: it does not fit the tunnel.
    """
    along, across = extent[0] / 2 + clearance[0], np.max(extent[1:]) / 2 + clearance[1]
    room = min(fidelity.upstream, fidelity.downstream)
    if along > room or across > fidelity.height / 2:
        sides = " x ".join(f"{side:g}" for side in extent)
        most = max(2 * (room - clearance[0]), 0), max(fidelity.height - 2 * clearance[1], 0)
        raise TooLarge(
            f"body: {sides} D is too large for the {fidelity.name} domain, which holds "
            f"{most[0]:g} D along the stream and {most[1]:g} D across; bodies are best scaled to "
            "an equivalent diameter of 1, and a larger domain is a Fidelity of one's own"
        )
    if isinstance(stream, Tunnel) and stream.height < extent[1] + 1:
        needed = math.ceil(100 * (extent[1] + 1)) / 100
        raise InvalidInput(
            f"tunnel:{stream.height:g} leaves less than half a diameter above and below a box "
            f"{extent[1]:g} D high around the body as it lies; tunnel:{needed:g} would do"
        )
