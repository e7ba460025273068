"""The reference length of a problem: the equivalent diameter D, or the chord c of each body."""

import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from shapeopt.problem.scenarios import LoadModel
from surrogate.arrays import AnyArray
from surrogate.body.body_class import BodyClass
from surrogate.body.chord_line import loads_by_chord


@dataclasses.dataclass(frozen=True)
class Reference:
    """Reference length of the Reynolds numbers, coefficients and bounds of a problem.

    Based on the chord c, a problem asks for the best body of fixed chord, with its area free: at a
    given U c / nu its loads are Cd / c, Cl / c and Cm / c^2, with c in D.

    Args:
      body_class: of the bodies.
      by_chord: whether it is the chord of each body; otherwise it is D.
    """

    body_class: BodyClass
    by_chord: bool = False

    @property
    def symbol(self) -> str:
        """The length's symbol, for messages."""
        return "c" if self.by_chord else "D"

    def length(self, parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, ""]:
        """Return the reference length of a body, in D."""
        return self.body_class.length(parameters) if self.by_chord else np.ones(())

    def query(
        self, parameters: Float[AnyArray, " parameters"], reynolds: float
    ) -> tuple[Float[AnyArray, " parameters"], float]:
        """Return the body and U D / nu, from a Reynolds number based on the reference length."""
        return parameters, float(reynolds / self.length(parameters))

    def loads(
        self, parameters: Float[AnyArray, " parameters"], loads: Float[AnyArray, " loads"]
    ) -> Float[AnyArray, " loads"]:
        """Return the loads of a body based on the reference length, from those based on D."""
        return loads_by_chord(loads, self.length(parameters))

    def slopes(
        self,
        parameters: Float[AnyArray, " parameters"],
        loads: Float[AnyArray, " loads"],
        slopes: Float[AnyArray, "loads inputs"],
    ) -> Float[AnyArray, "loads inputs"]:
        """Return derivatives of ``loads(parameters, loads)`` by the parameters and log Re.

        Args:
          parameters: of the body.
          loads: by D.
          slopes: their derivatives by the parameters and log Re, by D, where Re is by D too.
        """
        if not self.by_chord:
            return slopes
        return _slopes_by_chord(self, parameters, loads, slopes)

    def model(self, model: LoadModel) -> LoadModel:
        """Return a model of loads based on the reference length, from one based on D."""
        return ByChord(model, self) if self.by_chord else model


def covered_aspects(
    reynolds: Float[AnyArray, " cases"], covered: tuple[float, float]
) -> tuple[float, float]:
    """Return the least and greatest aspect of 2-D bodies whose flows are covered.

    The chord of a 2-D body of aspect a is sqrt(a) D, so that U D / nu = R / sqrt(a).

    Args:
      reynolds: R = U c / nu of all flows.
      covered: least and greatest U D / nu.
    """
    low, high = covered
    return float(max(reynolds) / high) ** 2, float(min(reynolds) / low) ** 2


class ByChord(eqx.Module):
    """Wraps a model of loads based on D: takes chord Reynolds numbers, returns loads over c."""

    model: LoadModel
    reference: Reference = eqx.field(static=True)

    def loads(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[Array, " loads"]:
        """Return Cd, Cl and Cm of a body by its chord, at a Reynolds number U c / nu."""
        by_diameter = self.model.loads(parameters, reynolds / self.reference.length(parameters))
        return self.reference.loads(parameters, by_diameter)


class _Linear(eqx.Module):
    """First-order Taylor model of loads based on D, about a body and U D / nu = 1."""

    body: Float[AnyArray, " parameters"]
    values: Float[AnyArray, " loads"]
    slopes: Float[AnyArray, "loads inputs"]

    def loads(self, parameters, reynolds):
        change = jnp.append(parameters - self.body, jnp.log(reynolds))
        return self.values + self.slopes @ change


@functools.partial(jax.jit, static_argnums=0)
def _slopes_by_chord(reference, parameters, loads, slopes):
    """Differentiate the linear model where U D / nu = 1, so that U c / nu is the chord."""
    model = ByChord(_Linear(parameters, loads, slopes), reference)

    def by_inputs(inputs):
        return model.loads(inputs[:-1], jnp.exp(inputs[-1]))

    return jax.jacfwd(by_inputs)(jnp.append(parameters, jnp.log(reference.length(parameters))))
