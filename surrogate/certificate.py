"""A prediction checked by the flow: the flow it drives, and one coupled Newton step from there."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from surrogate.arrays import AnyArray
from surrogate.body import family_markers
from surrogate.errors import NotConverged
from surrogate.flow import steady
from surrogate.flow.forces import drag_coefficient
from surrogate.flow.newton import NewtonSettings
from surrogate.flow.tangent import Effort, coupled_step
from surrogate.store import Surrogate
from surrogate.training.physics import scene_domain


class Certificate(NamedTuple):
    """Corrected drag, relative error it implies, rms slip of the prediction (U), and work."""

    cd_corrected: float
    estimated_error: float
    slip: float
    certificate_green_applications: int


def certify(surrogate: Surrogate, parameters: AnyArray, reynolds: float) -> Certificate:
    """Correct a predicted drag by the flow that the predicted traction drives.

    That flow is solved loosely; its slip and one coupled Newton step of body flow from there give
    a drag whose error is quadratic in the prediction's. The correction estimates that error.

    Raises:
      NotConverged: the driven flow or the step was not found.
    """
    domain = scene_domain(surrogate.scene)
    check = _check(domain, surrogate.network, jnp.asarray(parameters), jnp.asarray(reynolds, float))
    corrected, predicted = float(check.corrected), float(check.predicted)
    if not (bool(check.converged) and np.isfinite(corrected)):
        raise NotConverged(
            f"certificate at Re {reynolds:g}: the flow of the prediction is not found"
        )
    work = int(check.products) + steady.preparation_cost(domain)
    return Certificate(corrected, abs(predicted / corrected - 1), float(check.slip), work)


class _Check(NamedTuple):
    corrected: Array
    predicted: Array
    slip: Array
    products: Array
    converged: Array


@functools.partial(jax.jit, static_argnums=0)
def _check(domain, network, parameters, reynolds):
    amplitude = network(parameters, reynolds)
    case = steady.prepare(domain, family_markers(parameters, domain.nodes), reynolds)
    velocity, info = steady.forced_flow(
        domain, case, amplitude, settings=NewtonSettings(tolerance=1e-2)
    )
    driven = steady.FlowState(velocity, amplitude)
    slip = steady.slip_residual(domain, case, driven)
    corrected, cost = coupled_step(domain, case, driven, Effort())
    return _Check(
        drag_coefficient(corrected.amplitude),
        drag_coefficient(amplitude),
        jnp.sqrt(jnp.mean(slip**2)),
        info.products + cost.products,
        info.converged & cost.converged,
    )
