"""What models predict of a body's loads: log Cd, and where there is lift Cl / Cd and Cm / Cd.

Drag spans decades over Re while its logarithm is smooth; lift and moment change their sign, and
over the drag they are of order one at most.
"""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.model.inputs import Inputs

SYMBOLS = {"drag": "Cd", "lift": "Cl", "moment": "Cm"}  # of the loads, by their names in records
LOAD_NAMES = tuple(SYMBOLS)
PARITY = np.array([1.0, -1.0, -1.0])  # of log Cd, Cl / Cd, Cm / Cd under the mirror image


class OutputModel(eqx.Module):
    """A model of the outputs at scaled inputs: a network, or kriging."""

    inputs: eqx.AbstractVar[Inputs]

    @abc.abstractmethod
    def outputs(self, z: Float[AnyArray, " inputs"]) -> Float[Array, " loads"]:
        """Return log Cd, and where there is lift Cl / Cd and Cm / Cd, at scaled inputs."""

    def drag(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[AnyArray, ""]:
        """Return the drag coefficient Cd of a body."""
        return jnp.exp(self.outputs(self.inputs(parameters, reynolds))[0])

    def loads(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[AnyArray, " loads"]:
        """Return Cd of a body, and where there is lift Cl and Cm."""
        return loads_of(self.outputs(self.inputs(parameters, reynolds)))


def outputs_of(loads: Float[AnyArray, " loads"]) -> Float[Array, " loads"]:
    """Return log Cd (, Cl / Cd, Cm / Cd) of loads Cd (, Cl, Cm)."""
    return jnp.append(jnp.log(loads[:1]), loads[1:] / loads[0])


def loads_of(outputs: Float[AnyArray, " loads"]) -> Float[Array, " loads"]:
    """Return loads Cd (, Cl, Cm) of log Cd (, Cl / Cd, Cm / Cd), the inverse of ``outputs_of``."""
    return jnp.exp(outputs[0]) * jnp.append(1.0, outputs[1:])


@jax.jit
def gradients_of_outputs(
    loads: Float[AnyArray, " loads"], gradients: Float[AnyArray, "loads inputs"]
) -> Float[Array, "loads inputs"]:
    """Return the gradients of the outputs from those of the loads."""
    return jax.jacfwd(outputs_of)(loads) @ gradients


@jax.jit
def gradients_of_loads(
    loads: Float[AnyArray, " loads"], gradients: Float[AnyArray, "loads inputs"]
) -> Float[Array, "loads inputs"]:
    """Return the gradients of the loads from those of the outputs."""
    return jax.jacfwd(loads_of)(outputs_of(loads)) @ gradients
