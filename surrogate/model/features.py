"""Input features of load networks; of 3-D bodies at incidence some are products with sines of it.

A 3-D body that is reversed, which negates its even sine modes, and turned by 180 degrees is the
same body. Networks of 3-D bodies at incidence see the other inputs and

    cos 2a,  sin 2a,  beta_k cos a,  beta_k sin a  for even k,

with the incidence a. These are the same for both descriptions of a body and differ for any other
two bodies, so that loads have every symmetry of the bodies exactly: also that of a body which is
symmetric fore and aft, which has no lift and no moment at 90 degrees.
"""

import enum
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.body_class import BodyClass


class Wave(enum.IntEnum):
    """The function of the incidence a by which a feature is multiplied."""

    ONE = 0
    COS = 1
    SIN = 2
    COS_2 = 3
    SIN_2 = 4


class Feature(NamedTuple):
    """A feature of the network: a scaled input times a wave, a function of the incidence.

    For the incidence itself it is the wave alone. ``source`` is the index of the input.
    """

    source: int
    wave: Wave


def incidence_index(body_class: BodyClass) -> int | None:
    """Return the index of the incidence if it enters by waves, as for bodies in 3-D, else None."""
    has_incidence = body_class.dimension == 3 and "incidence" in body_class.names
    return body_class.names.index("incidence") if has_incidence else None


def negated_by_reversal(body_class: BodyClass) -> list[bool]:
    """Return which parameters change their sign if nose and tail of a body exchange their names.

    These are the even sine modes of bodies with incidence in 3-D; other bodies have none.
    """
    has_incidence = incidence_index(body_class) is not None
    return [has_incidence and p.odd_fore_and_aft for p in body_class.parameters]


def features_of(body_class: BodyClass) -> tuple[Feature, ...]:
    """Return the features of a class of bodies, in the order of its parameters and Re."""
    index, found = incidence_index(body_class), []
    for source, reverses in enumerate([*negated_by_reversal(body_class), False]):
        waves = (Wave.COS, Wave.SIN) if reverses else (Wave.ONE,)
        waves = (Wave.COS_2, Wave.SIN_2) if source == index else waves
        found += [Feature(source, wave) for wave in waves]
    return tuple(found)


def stokes_moment_features(body_class: BodyClass) -> tuple[int, ...]:
    """Return the indices of the features beta_k sin a of 3-D bodies with incidence, else ().

    The moment in Stokes flow is a sum of multiples of these, since a body that is symmetric fore
    and aft has none there.
    """
    if incidence_index(body_class) is None:
        return ()
    return tuple(k for k, f in enumerate(features_of(body_class)) if f.wave is Wave.SIN)


def evaluate_features(
    body_class: BodyClass, z: Float[AnyArray, " inputs"], degrees: Float[AnyArray, ""] | float
) -> Float[Array, " features"]:
    """Return the features at scaled inputs z.

    Args:
      body_class: of the bodies.
      z: scaled inputs.
      degrees: incidence at which its scaled input is 1.
    """
    index = incidence_index(body_class)
    if index is None:
        return jnp.asarray(z)
    sources, waves = np.array(features_of(body_class)).T
    a = jnp.deg2rad(degrees * z[index])
    values = jnp.stack([jnp.ones_like(a), *(f(k * a) for k in (1, 2) for f in (jnp.cos, jnp.sin))])
    return jnp.asarray(z).at[index].set(1.0)[sources] * values[waves]


def mirror_of_features(
    body_class: BodyClass, mirror: Float[np.ndarray, " inputs"]
) -> Float[np.ndarray, " features"]:
    """Return the factors, 1 or -1, from a body's features to those of its mirror image.

    Args:
      body_class: of the bodies.
      mirror: the same factors of the scaled inputs.
    """
    if incidence_index(body_class) is None:
        return mirror
    odd = (Wave.SIN, Wave.SIN_2)
    return np.array([-1.0 if f.wave in odd else 1.0 for f in features_of(body_class)])
