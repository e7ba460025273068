"""The drag as a function that JAX differentiates, and its gradient by one adjoint.

The rule is a custom JVP: the gradient is computed by the adjoint and contracted with the tangent,
which is linear, so JAX transposes it. Forward and reverse mode cost the same, one adjoint.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.compilation import compiled
from surrogate.errors import NotConverged
from surrogate.flow import programs
from surrogate.flow.discrete import DiscreteBodies
from surrogate.flow.loads import drag, drag_coefficient
from surrogate.flow.solver.adjoint import Effort
from surrogate.flow.solver.newton import NewtonInfo
from surrogate.flow.solver.steady import FlowState, Operators

# Gradients of designs and trainings need no more than kriging's noise of slopes, 2e-4.
QUICK_ADJOINT = Effort(2e-4, 60)


class DragGradient(NamedTuple):
    """Cd and its derivatives in parameters and Re, to about 2e-4; NaN where not converged.

    ``green_applications`` counts the convolutions with G of flow and adjoint.
    """

    drag: Float[AnyArray, "*bodies"]
    gradient: Float[AnyArray, "*bodies parameters"]
    by_reynolds: Float[AnyArray, "*bodies"]
    green_applications: Int[AnyArray, "*bodies"]
    converged: Bool[AnyArray, "*bodies"]


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def drag_and_status(
    bodies: DiscreteBodies,
    parameters: Float[AnyArray, " parameters"],
    reynolds: Float[AnyArray, ""],
) -> tuple[Float[Array, ""], NewtonInfo]:
    """Return Cd of a body, differentiable in both arguments, and the solver's outcome."""
    _, state, info = bodies.solved(parameters, reynolds)
    return drag_coefficient(state.amplitude), info


@drag_and_status.defjvp
def _drag_tangent(bodies, primals, tangents):
    operators, state, info = bodies.solved(*primals)
    by_parameters, by_reynolds = exact_gradient(bodies, *primals, state, operators)
    change = by_parameters @ tangents[0] + by_reynolds * tangents[1]
    return (drag_coefficient(state.amplitude), info), (change, jax.tree.map(_no_tangent, info))


def _no_tangent(leaf):
    inexact = jnp.issubdtype(leaf.dtype, jnp.inexact)
    return jnp.zeros_like(leaf) if inexact else np.zeros(leaf.shape, jax.dtypes.float0)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def exact_gradient(
    bodies: DiscreteBodies,
    parameters: Float[AnyArray, " parameters"],
    reynolds: Float[AnyArray, ""],
    state: FlowState,
    operators: Operators | None = None,
) -> tuple[Float[Array, " parameters"], Float[Array, ""]]:
    """Return dCd/d(parameters, Re) to as many digits as the flow has; NaN where not converged."""
    if operators is None:
        operators = programs.assemble(bodies.domain, bodies.markers(parameters), reynolds)
    effort = Effort(bodies.settings.linear_tolerance, bodies.settings.max_vectors)
    found = programs.load_gradient(drag, bodies.domain, effort, operators, state, reynolds)
    return _in_parameters(bodies, parameters, found)


@exact_gradient.defjvp
def _second_derivative(bodies, primals, tangents):
    raise NotImplementedError(
        "second derivatives of the flow's drag: not provided, as the adjoint's own derivative "
        "would take two more solves of full precision; difference its gradient, or take those of "
        "a surrogate"
    )


@compiled("bodies")
def _in_parameters(bodies, parameters, found):
    """Return a gradient in the markers as one in the body's parameters; NaN if not converged."""
    by_parameters = jax.vjp(bodies.markers, parameters)[1](found.by_markers)[0]
    return tuple(
        jnp.where(found.work.converged, part, jnp.nan)
        for part in (by_parameters, found.by_reynolds)
    )


def named_gradient(
    bodies: DiscreteBodies,
    parameters: Float[AnyArray, " parameters"],
    reynolds: float,
    state: FlowState,
) -> dict[str, float]:
    """Return dCd/d(parameters, Re) of a solved body by the parameters' names and ``reynolds``.

    Raises:
      NotConverged: the adjoint did not converge.
    """
    at = jnp.asarray(parameters, float), jnp.asarray(reynolds, float)
    by_parameters, by_reynolds = exact_gradient(bodies, *at, state)
    flat = np.array([*by_parameters, by_reynolds], float)
    if not np.all(np.isfinite(flat)):
        raise NotConverged(f"adjoint flow at Re {reynolds:g} did not converge")
    return dict(zip((*bodies.body_class.names, "reynolds"), flat.tolist(), strict=True))


def drag_and_gradient(
    bodies: DiscreteBodies,
    parameters: Float[AnyArray, " parameters"],
    reynolds: Float[AnyArray, ""],
) -> DragGradient:
    """Return Cd of a body and its gradient by one adjoint, to ``QUICK_ADJOINT``."""
    operators, state, info = bodies.solved(parameters, reynolds)
    found = programs.load_gradient(drag, bodies.domain, QUICK_ADJOINT, operators, state, reynolds)
    return _drag_gradient(bodies, parameters, state, info, found)


@compiled("bodies")
def _drag_gradient(bodies, parameters, state, info, found):
    by_parameters, by_reynolds = _in_parameters(bodies, parameters, found)
    converged = info.converged & found.work.converged & jnp.all(jnp.isfinite(by_parameters))
    spent = info.products + found.work.products + bodies.domain.assembly_cost
    values = drag_coefficient(state.amplitude), by_parameters, by_reynolds
    return DragGradient(*(jnp.where(converged, v, jnp.nan) for v in values), spent, converged)
