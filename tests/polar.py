"""A scene of small flows with lift, and a known polar, for tests of designs with lift."""

import equinox as eqx
import jax.numpy as jnp
from conftest import SECTIONS, TINY

from surrogate import Scene

SCENE, CURVES = Scene(family=SECTIONS, fidelity=TINY, reynolds=(5, 20)), ("beta2", "gamma2")


class Polar(eqx.Module):
    """Loads of a parabolic drag polar, Cd = 2 + Cl^2 / 2, Cl = incidence / 4, Cm = gamma2 - Cl / 4.

    The greatest glide ratio, 1 / 2, is at Cl = 2.
    """

    def loads(self, parameters, reynolds):
        lift = parameters[3] / 4
        return jnp.stack([2 + lift**2 / 2, lift, parameters[2] - lift / 4])
