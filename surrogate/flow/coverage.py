"""Which bodies and Reynolds numbers the flow of a scene answers, on its one grid."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from surrogate.arrays import AnyArray, Body, Number, Numbers
from surrogate.body.validity import is_valid
from surrogate.checks import real_numbers, shown
from surrogate.errors import InvalidInput
from surrogate.flow.discrete import DiscreteBodies
from surrogate.scene.limits import REYNOLDS, ROUNDING, check_reynolds
from surrogate.scene.scene import Scene


@functools.partial(jax.jit, static_argnames=("scene", "bodies", "allow_unsteady"), inline=True)
def covers(
    scene: Scene,
    bodies: DiscreteBodies,
    parameters: Float[AnyArray, " parameters"],
    reynolds: Float[AnyArray, ""],
    allow_unsteady: bool,
) -> Bool[Array, ""]:
    """Return whether ``checked`` would accept a body and a Reynolds number, for traced values.

    Args:
      scene: of the flow.
      bodies: the scene's class of bodies on its grid.
      parameters: of the body.
      reynolds: U D / nu.
      allow_unsteady: accept what is beyond the onset of instability too.
    """
    parameters, reynolds = jax.lax.stop_gradient((parameters, reynolds))  # a truth value has none
    found = bodies.coverage(parameters)
    onset = jnp.inf if allow_unsteady else found.onset
    lowest = max(REYNOLDS[scene.dimension][0], bodies.domain.least_reynolds)
    body = is_valid(scene.family.body_class, parameters)
    steady = reynolds <= jnp.minimum(scene.reynolds[1], onset) * (1 + ROUNDING)
    return body & found.fits & found.resolved & (reynolds >= lowest * (1 - ROUNDING)) & steady


def checked(
    scene: Scene, bodies: DiscreteBodies, parameters: Body, reynolds: Number, allow_unsteady: bool
) -> tuple[Float[np.ndarray, " parameters"], float]:
    """Return a body and a Reynolds number that the scene's grid covers, as numbers.

    Args:
      scene: of the flow.
      bodies: the scene's class of bodies on its grid.
      parameters: of the body.
      reynolds: U D / nu.
      allow_unsteady: accept what is beyond the onset of instability too.

    Raises:
      InvalidInput: there is no such body or Reynolds number, or the grid does not cover it.
    """
    body = scene.family.check(parameters)
    _check_within(scene, bodies, reynolds)
    onset = float(bodies.check(body[None]).onset[0])
    return body, check_reynolds(reynolds, scene.dimension, math.inf if allow_unsteady else onset)


def checked_numbers(
    scene: Scene, bodies: DiscreteBodies, reynolds: Numbers, count: int
) -> Float[np.ndarray, " bodies"]:
    """Return ``count`` Reynolds numbers that the scene covers, from as many or from one for all.

    Args:
      scene: of the flow.
      bodies: the scene's class of bodies on its grid.
      reynolds: U D / nu.
      count: number of bodies.

    Raises:
      InvalidInput: there are neither as many nor one, or the scene does not cover one of them.
    """
    given = real_numbers(reynolds)
    if given is None or given.shape not in ((), (count,)):
        raise InvalidInput(
            f"Reynolds numbers {shown(reynolds)}: {count} numbers are needed, or one for all"
        )
    for extreme in (given.min(), given.max()) if given.size else ():
        _check_within(scene, bodies, extreme)
    return np.broadcast_to(given, (count,))


def check_steady(
    reynolds: Float[np.ndarray, " bodies"], onset: Float[np.ndarray, " bodies"], dimension: int
) -> None:
    """Raise InvalidInput if the Reynolds number of a body is beyond its onset of instability."""
    late = reynolds > onset * (1 + ROUNDING)
    if np.any(late):
        first = int(np.argmax(late))
        check_reynolds(reynolds[first], dimension, float(onset[first]))


def _check_within(scene, bodies, reynolds):
    """Raise InvalidInput unless a Reynolds number is one that the scene's grid is made for."""
    value = check_reynolds(reynolds, scene.dimension)
    lowest, highest = bodies.domain.least_reynolds, scene.reynolds[1]
    wider = "; a Scene with a wider range of Reynolds numbers would do"
    if value > highest * (1 + ROUNDING):
        made = f"the scene's grid is made for wakes up to Re {highest:g}"
        raise InvalidInput(f"Reynolds number {value:g}: {made}{wider}")
    if value < lowest * (1 - ROUNDING):
        made = f"the scene's far field is large enough from Re {lowest:.4g} on"
        raise InvalidInput(f"Reynolds number {value:g}: {made}{wider}")
