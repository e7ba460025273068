"""Flows of many bodies, partitioned over devices."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.body.family import Family
from surrogate.compilation import same_options
from surrogate.flow.derivatives import LoadsAndGradients, loads_and_gradients
from surrogate.flow.discrete import DiscreteBodies
from surrogate.flow.loads import load_values
from surrogate.partition import Partition


class FlowBatch(NamedTuple):
    """Solved flows of many bodies: traction modes, loads, convolutions with G, and convergence.

    Loads are Cd and, of bodies with lift, Cl and Cm; NaN where a flow did not converge.
    """

    amplitude: Float[AnyArray, "bodies modes"]
    loads: Float[AnyArray, "bodies loads"]
    green_applications: Int[AnyArray, " bodies"]
    converged: Bool[AnyArray, " bodies"]

    @property
    def drag(self) -> Float[AnyArray, " bodies"]:
        """The drag coefficients Cd."""
        return self.loads[:, 0]


def estimated_cost(
    family: Family,
    parameters: Float[AnyArray, "bodies parameters"],
    reynolds: Float[AnyArray, " bodies"],
) -> Float[np.ndarray, " bodies"]:
    """Return Re / sqrt(aspect), with which the work of a flow increases (for load balancing)."""
    return np.asarray(reynolds) / np.sqrt(family.body_class.aspect(np.asarray(parameters)))


@functools.cache
def batch_solver(
    bodies: DiscreteBodies, gradients: bool = False
) -> Callable[[Partition, AnyArray, AnyArray], FlowBatch | LoadsAndGradients]:
    """Return a compiled function of (partition, parameters, reynolds) that solves many flows.

    With ``gradients`` it solves the adjoints too and returns ``LoadsAndGradients``.
    """

    def flow(body):
        operators, state, info = bodies.solved(*body)
        spent = info.convolutions + bodies.domain.assembly_cost
        loads = load_values(bodies.domain.modes, bodies.loads, state.amplitude, operators.markers)
        known = jnp.where(info.converged, 1.0, jnp.nan)
        return FlowBatch(state.amplitude, known * loads, spent, info.converged)

    def gradient(body):
        return loads_and_gradients(bodies, *body)

    def every(partition, parameters, reynolds):
        one = gradient if gradients else flow
        return partition.gather(partition.map(one, partition.scatter((parameters, reynolds))))

    options = same_options(bodies.domain.lattice.dimension, gradients)
    return jax.jit(every, compiler_options=options)
