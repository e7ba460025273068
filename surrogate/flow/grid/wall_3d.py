"""Wall treatment in 3-D: a slip law on the wall at low Re, mixed with retraction at high Re."""

import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.skin import Skin
from surrogate.flow.grid.immersed import Wall, slip_law
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes_3d import Modes3D
from surrogate.flow.grid.retraction import retract

# Where a boundary layer has few cells, the smeared sheet's own inertia counts. It lowers the drag
# of bluff bodies under the slip law; retraction and its second order lower it too, and a mixture of
# both leaves little. The study ``constants`` varies each constant alone.
THIN_LAYER_RE = 40.0  # about which boundary layers thin to few cells; 20 and 80 double the error
RETRACTED_SHARE = 0.8  # of the retraction, far beyond that Re; 0.6 and 1 are worse on average
SECOND_ORDER = 12.0  # coefficient c of the retraction per D: cancels the Stokes sphere's error


def wall_3d(
    lattice: Lattice, modes: Modes3D, skin: Skin, reynolds: Float[AnyArray, ""] | float
) -> Wall:
    """Return the discretised wall of a 3-D body, with slip law and retraction by their shares.

    The share of retraction rises with Re, see ``thin_layer``.

    Args:
      lattice: the grid.
      modes: traction modes.
      skin: markers and area vectors of the body.
      reynolds: U D / nu.
    """
    points, normal = skin
    speed = jnp.linalg.norm(normal, axis=1, keepdims=True)
    unit, slip_share = normal / speed, 1 - RETRACTED_SHARE * thin_layer(reynolds)
    retracted, cells = retract(lattice, points, unit, SECOND_ORDER, 1 - slip_share)
    values, weights = modes.values(skin.nodes), modes.weights(skin.nodes)
    compliance = slip_share * reynolds * lattice.step[0] * (cells / speed)[:, 0]
    law = slip_law(values, unit, skin.nodes.parts * weights * compliance)
    return Wall(retracted, values, weights, normal, law, skin.nodes[:2])


def thin_layer(reynolds: ArrayLike) -> ArrayLike:
    """Return a blend from 0 (boundary layers of many cells, low Re) to 1 (few cells, high Re)."""
    return reynolds**4 / (reynolds**4 + THIN_LAYER_RE**4)
