"""The loads as functions that JAX differentiates, and their gradients by an adjoint each.

The rule is a custom JVP: gradients are computed by adjoints and contracted with the tangent, which
is linear, so JAX transposes it. Forward and reverse mode cost the same, one adjoint a load.
"""

import functools
from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.compilation import compiled
from surrogate.errors import NotConverged
from surrogate.flow import programs
from surrogate.flow.discrete import DiscreteBodies
from surrogate.flow.loads import Load, drag, load_values
from surrogate.flow.solver.adjoint import Effort
from surrogate.flow.solver.newton import NewtonInfo
from surrogate.flow.solver.steady import FlowState, Operators
from surrogate.flow.streams import kept_derivatives

# Of the adjoints for designs and trainings: the slopes of log Cd, Cl / Cd and Cm / Cd in scaled
# inputs then err by about ``SLOPE_NOISE``, which kriging assumes (root mean squares, study
# ``lift_cost``). The slopes of the drag are the smallest relative to their adjoint, which so needs
# a smaller residual.
QUICK = Effort(7e-4, 60)
QUICK_DRAG = QUICK._replace(tolerance=2e-4)


class LoadsAndGradients(NamedTuple):
    """Loads and their derivatives in parameters and Re, by ``quick_efforts``; NaN if not converged.

    The loads are Cd alone for classes of symmetric bodies, else Cd, Cl and Cm.
    ``green_applications`` counts the convolutions with G of flow and adjoints.
    """

    loads: Float[AnyArray, "*bodies loads"]
    gradients: Float[AnyArray, "*bodies loads parameters"]
    by_reynolds: Float[AnyArray, "*bodies loads"]
    green_applications: Int[AnyArray, "*bodies"]
    converged: Bool[AnyArray, "*bodies"]

    @property
    def drag(self) -> Float[AnyArray, "*bodies"]:
        """The drag coefficients Cd."""
        return self.loads[..., 0]

    @property
    def gradient(self) -> Float[AnyArray, "*bodies parameters"]:
        """The derivatives of Cd in the parameters."""
        return self.gradients[..., 0, :]


@functools.partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def loads_and_status(
    bodies: DiscreteBodies,
    loads: tuple[Load, ...],
    parameters: Float[AnyArray, " parameters"],
    reynolds: Float[AnyArray, ""],
) -> tuple[Float[Array, " loads"], NewtonInfo]:
    """Return loads of a body, differentiable in parameters and Re, and the solver's outcome.

    Args:
      bodies: the grid and the class of bodies.
      loads: functions as in ``surrogate.flow.loads``.
      parameters: of the body.
      reynolds: U D / nu.
    """
    operators, state, info = bodies.solved(parameters, reynolds)
    return load_values(bodies.domain.modes, loads, state.amplitude, operators.markers), info


@functools.partial(loads_and_status.defjvp, symbolic_zeros=True)
def _loads_tangent(bodies, loads, primals, tangents):
    body_fixed, reynolds_fixed = (isinstance(tangent, SymbolicZero) for tangent in tangents)
    operators, state, info = bodies.solved(*primals)
    gradients = exact_gradients(bodies, loads, not reynolds_fixed, *primals, state, operators)
    values = load_values(bodies.domain.modes, loads, state.amplitude, operators.markers)
    change = jnp.zeros_like(values) if body_fixed else gradients[0] @ tangents[0]
    change += 0.0 if reynolds_fixed else gradients[1] * tangents[1]
    return (values, info), (change, jax.tree.map(_no_tangent, info))


def _no_tangent(leaf):
    inexact = jnp.issubdtype(leaf.dtype, jnp.inexact)
    return jnp.zeros_like(leaf) if inexact else np.zeros(leaf.shape, jax.dtypes.float0)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0, 1, 2))
def exact_gradients(
    bodies: DiscreteBodies,
    loads: tuple[Load, ...],
    by_reynolds: bool,
    parameters: Float[AnyArray, " parameters"],
    reynolds: Float[AnyArray, ""],
    state: FlowState,
    operators: Operators | None = None,
) -> tuple[Float[Array, "loads parameters"], Float[Array, " loads"] | None]:
    """Return the derivatives of loads in parameters and Re, to as many digits as the flow has.

    Args:
      bodies: the grid and the class of bodies.
      loads: functions J as in ``surrogate.flow.loads``.
      by_reynolds: whether those in Re are wanted, which take a good part of the time.
      parameters: of the body, p.
      reynolds: U D / nu.
      state: of the flow past it.
      operators: of the body; assembled if not given.

    Returns:
      dJ/dp and dJ/dRe, None if not wanted; NaN where an adjoint has not converged.
    """
    domain = bodies.domain
    if operators is None:
        operators = bodies.assembled(parameters, reynolds)
    efforts = (Effort(bodies.settings.linear_tolerance, bodies.settings.max_vectors),) * len(loads)
    found = programs.load_gradients(loads, domain, operators, state, reynolds, efforts)
    at = domain, parameters, reynolds, operators, state
    by_re = _by_reynolds(*at, found, efforts) if by_reynolds else None
    return _in_parameters(bodies, parameters, found.by_markers, by_re, found.work.converged)


@exact_gradients.defjvp
def _second_derivatives(bodies, loads, by_reynolds, primals, tangents):
    raise NotImplementedError(
        "second derivatives of the flow's loads: not provided, as the adjoint's own derivative "
        "would take two more solves of full precision; difference its gradient, or take those of "
        "a surrogate"
    )


def _by_reynolds(domain, parameters, reynolds, operators, state, found, efforts):
    """Return dJ/dRe, by the operators of the body and of the stream."""
    derivatives = kept_derivatives(domain, reynolds, parameters)
    by_stream = programs.by_stream(domain, operators, state, derivatives, found.adjoints, efforts)
    return found.by_reynolds + by_stream


@compiled("bodies")
def _in_parameters(bodies, parameters, by_markers, by_reynolds, converged):
    """Return gradients in the markers as those in the body's parameters; NaN if not converged."""
    found = bodies.in_parameters(parameters, by_markers), by_reynolds
    return jax.tree.map(lambda part: jnp.where(converged, part, jnp.nan), found)


def named_gradients(
    bodies: DiscreteBodies,
    loads: Mapping[str, Load],
    parameters: Float[AnyArray, " parameters"],
    reynolds: float,
    state: FlowState,
) -> dict[str, dict[str, float]]:
    """Return for every load its derivatives by the parameters' names and "reynolds".

    Args:
      bodies: the grid and the class of bodies.
      loads: functions as in ``surrogate.flow.loads``, by name.
      parameters: of the body.
      reynolds: U D / nu.
      state: of the flow past it.

    Raises:
      NotConverged: an adjoint did not converge.
    """
    at = jnp.asarray(parameters, float), jnp.asarray(reynolds, float)
    by_parameters, by_reynolds = exact_gradients(bodies, tuple(loads.values()), True, *at, state)
    rows = np.column_stack([by_parameters, by_reynolds])
    if not np.all(np.isfinite(rows)):
        raise NotConverged(f"adjoint flow at Re {reynolds:g} did not converge")
    names = *bodies.body_class.names, "reynolds"
    return {
        load: dict(zip(names, row, strict=True))
        for load, row in zip(loads, rows.tolist(), strict=True)
    }


def quick_efforts(loads: tuple[Load, ...]) -> tuple[Effort, ...]:
    """Return the efforts of the adjoints of loads whose gradients are for designs and trainings."""
    return tuple(QUICK_DRAG if load is drag else QUICK for load in loads)


def loads_and_gradients(
    bodies: DiscreteBodies,
    parameters: Float[AnyArray, " parameters"],
    reynolds: Float[AnyArray, ""],
) -> LoadsAndGradients:
    """Return the loads of a body and their gradients by one adjoint for each load.

    The adjoints are solved by ``quick_efforts``; see ``LoadsAndGradients``.
    """
    domain = bodies.domain
    operators, state, info = bodies.solved(parameters, reynolds)
    efforts = quick_efforts(bodies.loads)
    found = programs.load_gradients(bodies.loads, domain, operators, state, reynolds, efforts)
    by_re = _by_reynolds(domain, parameters, reynolds, operators, state, found, efforts)
    values = load_values(bodies.domain.modes, bodies.loads, state.amplitude, operators.markers)
    return _loads_and_gradients(
        bodies, parameters, values, info, found.by_markers, by_re, found.work
    )


@compiled("bodies")
def _loads_and_gradients(bodies, parameters, values, info, by_markers, by_reynolds, work):
    gradients = _in_parameters(bodies, parameters, by_markers, by_reynolds, work.converged)
    converged = info.converged & work.converged & jnp.all(jnp.isfinite(gradients[0]))
    spent = info.convolutions + work.convolutions + bodies.domain.assembly_cost
    parts = values, *gradients
    return LoadsAndGradients(*(jnp.where(converged, v, jnp.nan) for v in parts), spent, converged)
