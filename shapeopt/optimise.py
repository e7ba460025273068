"""The search: SLSQP from many starts, on the surrogate or directly on the flow's adjoint."""

import dataclasses
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

from shapeopt.problem import Problem, margins
from surrogate.arrays import AnyArray
from surrogate.body import ellipse
from surrogate.errors import NotConverged
from surrogate.flow.drag import family_drag_and_shape_gradient
from surrogate.flow.steady import preparation_cost
from surrogate.store import Surrogate
from surrogate.training.physics import scene_domain

Objective = Callable[[np.ndarray], tuple[float, np.ndarray]]


@dataclasses.dataclass(frozen=True)
class Optimum:
    """Best body found. ``calls`` counts drags asked for, ``path`` the bodies on the way there.

    ``green_applications`` counts the flow's work: none on the surrogate.
    """

    parameters: Float[AnyArray, " parameters"]
    drag: float
    calls: int
    seconds: float
    converged: bool
    path: Float[AnyArray, "steps parameters"]
    green_applications: int = 0


def optimise(problem: Problem, surrogate: Surrogate, starts: int = 8) -> Optimum:
    """Least predicted drag: rank all candidates at once, then polish the best by gradients.

    Raises:
      InvalidInput: no body satisfies the constraints.
      NotConverged: no start reached an optimum.
    """
    begin = time.perf_counter()
    candidates = problem.candidates()
    reynolds = jnp.asarray(problem.reynolds, float)
    ranked = np.argsort(_drags(surrogate.network, candidates, reynolds))

    def objective(parameters):
        value, gradient = _drag_and_gradient(surrogate.network, parameters, reynolds)
        return float(value), np.asarray(gradient)

    results = [_slsqp(problem, objective, start) for start in candidates[ranked[:starts]]]
    best = min(results, key=lambda optimum: (not optimum.converged, optimum.drag))
    if not best.converged:
        raise NotConverged("optimisation: none of the starts reached an optimum")
    calls = len(candidates) + sum(result.calls for result in results)
    return dataclasses.replace(best, calls=calls, seconds=time.perf_counter() - begin)


def optimise_directly(problem: Problem) -> Optimum:
    """The rival: the same search on body flow and adjoint, from the roundest feasible ellipse.

    Raises:
      InvalidInput, NotConverged: as ``optimise``, and where a flow on the way is not found.
    """
    begin = time.perf_counter()
    candidates = problem.candidates()
    start = candidates[np.argmin(_distance_from_start(problem, candidates))]
    domain = scene_domain(problem.scene)
    work = [0]

    def objective(parameters):
        value, gradient, info = family_drag_and_shape_gradient(
            domain, jnp.asarray(parameters), jnp.asarray(problem.reynolds, float)
        )
        if not (bool(info.converged) and np.all(np.isfinite(gradient))):
            raise NotConverged(f"direct optimisation: no flow at Re {problem.reynolds:g}")
        work[0] += int(info.products) + 2 * preparation_cost(domain)
        return float(value), np.asarray(gradient)

    best = _slsqp(problem, objective, start, tolerance=1e-6)
    if not best.converged:
        raise NotConverged("direct optimisation: SLSQP did not reach an optimum")
    seconds = time.perf_counter() - begin
    return dataclasses.replace(best, seconds=seconds, green_applications=work[0])


def _slsqp(problem: Problem, objective: Objective, start: np.ndarray, tolerance=1e-9) -> Optimum:
    """SLSQP in parameters scaled to [0, 1]."""
    begin = time.perf_counter()
    low, high = problem.scene.family.bounds.T
    width = high - low
    path, calls = [start], [0]

    def scaled(z):
        calls[0] += 1
        value, gradient = objective(low + width * z)
        return value, gradient * width

    def constraint(z):
        value, jacobian = _margins(low + width * z, problem.limits)
        return np.asarray(value), np.asarray(jacobian) * width

    result = minimize(
        scaled,
        (start - low) / width,
        jac=True,
        method="SLSQP",
        bounds=[(0, 1)] * len(low),
        constraints={
            "type": "ineq",
            "fun": lambda z: constraint(z)[0],
            "jac": lambda z: constraint(z)[1],
        },
        callback=lambda z: path.append(low + width * z),
        options={"ftol": tolerance, "maxiter": 100},
    )
    z = np.clip(result.x, 0, 1)
    feasible = bool(np.all(constraint(z)[0] >= -1e-6))
    return Optimum(
        parameters=low + width * z,
        drag=float(result.fun),
        calls=calls[0],
        seconds=time.perf_counter() - begin,
        converged=bool(result.success) and feasible and bool(np.isfinite(result.fun)),
        path=np.array(path),
    )


def _distance_from_start(problem, candidates):
    """How far a body is from a plain ellipse of aspect 2."""
    low, high = problem.scene.family.bounds.T
    return np.linalg.norm((candidates - ellipse(2.0)) / (high - low), axis=1)


@jax.jit
def _margins(parameters, limits):
    return margins(parameters, limits), jax.jacfwd(margins)(parameters, limits)


@jax.jit
def _drags(network, candidates, reynolds):
    return jax.vmap(lambda parameters: network.drag(parameters, reynolds))(candidates)


@jax.jit
def _drag_and_gradient(network, parameters, reynolds):
    return jax.value_and_grad(network.drag)(parameters, reynolds)
