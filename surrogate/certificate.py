"""A prediction checked by the flow: a loose body flow that starts from it."""

import dataclasses
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
from surrogate.flow.domain import Domain
from surrogate.flow.forces import drag_coefficient
from surrogate.flow.immersed import Modes, spread_modes
from surrogate.flow.newton import NewtonSettings, Problem, root
from surrogate.flow.steady import FlowState
from surrogate.network import DragNetwork
from surrogate.store import Surrogate
from surrogate.training.physics import scene_domain


class Certificate(NamedTuple):
    """Corrected drag, relative error it implies, rms slip it removes (U), and work."""

    cd_corrected: float
    estimated_error: float
    slip: float
    certificate_green_applications: int


class Thoroughness(NamedTuple):
    """``harmonics`` of the traction that are corrected (the rest stay as predicted), and limits."""

    harmonics: int | None
    settings: NewtonSettings


QUICK = Thoroughness(2, NewtonSettings(1e-3, 10, 40, forcing=0.5))
THOROUGH = Thoroughness(None, NewtonSettings(1e-4, 10, 40, forcing=0.5))


def certify(
    surrogate: Surrogate,
    parameters: AnyArray,
    reynolds: float,
    thoroughness: Thoroughness = THOROUGH,
) -> Certificate:
    """Correct a predicted drag by a loose body flow that starts from the predicted traction.

    The correction estimates the prediction's error. Nearly half of a flow's cost is the response to
    every traction mode, so ``QUICK`` solves for the coarse modes alone and keeps the predicted
    fine ones; what these get wrong stays in the corrected drag.

    Raises:
      NotConverged: the flow was not found.
    """
    domain = scene_domain(surrogate.scene)
    body, re = jnp.asarray(parameters), jnp.asarray(reynolds, float)
    check = correction(domain, surrogate.network, body, re, thoroughness)
    corrected, predicted = float(check.corrected), float(check.predicted)
    if not (bool(check.converged) and np.isfinite(corrected)):
        raise NotConverged(f"certificate at Re {reynolds:g}: the flow was not found")
    error = abs(predicted / corrected - 1)
    return Certificate(corrected, error, float(check.slip), int(check.products))


class Correction(NamedTuple):
    """Drags, rms slip, applications of G with the preparation, and whether the flow converged."""

    corrected: Array
    predicted: Array
    slip: Array
    products: Array
    converged: Array


@functools.partial(jax.jit, static_argnums=(0, 4))
def correction(
    domain: Domain,
    network: DragNetwork,
    parameters: AnyArray,
    reynolds: AnyArray,
    thoroughness: Thoroughness,
) -> Correction:
    """Solve for the coarse modes of the traction, the fine ones as the network has them.

    The fine modes drive a constant velocity, one application of G.
    """
    amplitude = network(parameters, reynolds)
    every = domain.modes.harmonics
    some = every if thoroughness.harmonics is None else min(thoroughness.harmonics, every)
    coarse = dataclasses.replace(domain, modes=Modes(some, symmetric=True))
    solved = np.r_[: some + 1, every + 1 : every + 1 + some]
    markers = family_markers(parameters, domain.nodes)
    case = steady.prepare(coarse, markers, reynolds)
    products = steady.preparation_cost(coarse)
    driven = jnp.zeros(())
    if some < every:
        body = spread_modes(domain.lattice, domain.modes, domain.box, markers)
        driven = case.kernel(body.spread(amplitude.at[solved].set(0.0)))
        products += 1

    def residual(data, state):
        case, driven = data
        flow = steady.flow_residual(coarse, case, state) - driven
        return FlowState(flow, steady.slip_residual(coarse, case, state))

    def norm(state):
        size = jnp.sqrt(domain.lattice.cell_area) * jnp.linalg.norm(state.velocity)
        return size + jnp.linalg.norm(state.amplitude)

    start = amplitude[solved]
    guess = FlowState(jnp.tensordot(start, case.response, axes=1) + driven, start)
    problem = Problem(residual, (case, driven), steady.eliminate(coarse, case))
    state, info = root(problem, guess, norm, thoroughness.settings)
    compliance = jax.vmap(case.body.slip)(case.response).T
    return Correction(
        drag_coefficient(state.amplitude),
        drag_coefficient(amplitude),
        jnp.sqrt(jnp.mean((compliance @ (state.amplitude - start)) ** 2)),
        info.products + products,
        info.converged,
    )
