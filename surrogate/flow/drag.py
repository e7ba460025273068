"""Drag of one body in one stream, as a user asks for it; the compiled entry points of the flow."""

import dataclasses
import functools
import math
import time
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body import PARAMETERS, family_markers
from surrogate.contour import mean_thickness
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow import steady
from surrogate.flow.domain import Domain, make_domain
from surrogate.flow.forces import Coefficients, coefficients, drag_coefficient
from surrogate.flow.newton import NewtonInfo, NewtonSettings
from surrogate.flow.tangent import Effort, drag_slope
from surrogate.scene import Fidelity, Stream, check_stream

THINNEST = 2.5  # cells across the mean thickness
ADJOINT = Effort(2e-4, 40)


class Solution(NamedTuple):
    """A solved body flow: state, force coefficients, and how the solve went."""

    state: steady.FlowState
    coefficients: Coefficients
    info: NewtonInfo


@functools.partial(jax.jit, static_argnames="domain")
def solve(
    domain: Domain,
    markers: Float[AnyArray, "nodes 2"],
    reynolds: Float[AnyArray, ""],
    guess: steady.FlowState | None = None,
) -> Solution:
    """Body flow of a contour; ``info.converged`` says whether the numbers mean anything."""
    case = steady.prepare(domain, markers, reynolds)
    state, info = steady.body_flow(domain, case, guess)
    forces = coefficients(domain, markers, *state, reynolds)
    return Solution(state, forces, info)


@functools.partial(jax.jit, static_argnames=("domain", "settings"))
def family_drag_and_gradient(
    domain: Domain,
    parameters: Float[AnyArray, " parameters"],
    reynolds: Float[AnyArray, ""],
    settings: NewtonSettings = steady.DEFAULT,
    guess: steady.FlowState | None = None,
) -> tuple[
    Float[AnyArray, ""], tuple[Float[AnyArray, " parameters"], Float[AnyArray, ""]], NewtonInfo
]:
    """Cd of a family body, its gradient in (parameters, Re) by one adjoint solve, and status.

    The derivative in Re runs back through the kernel and the far field as well.
    """

    def drag(parameters, reynolds):
        case = steady.prepare(domain, family_markers(parameters, domain.nodes), reynolds)
        state, info = steady.body_flow(domain, case, guess, settings)
        return drag_coefficient(state.amplitude), info

    (cd, info), gradient = jax.value_and_grad(drag, argnums=(0, 1), has_aux=True)(
        parameters, reynolds
    )
    return cd, gradient, info


@functools.partial(jax.jit, static_argnames="domain")
def family_drag_and_shape_gradient(
    domain: Domain, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
) -> tuple[Float[Array, ""], Float[Array, " parameters"], NewtonInfo]:
    """Cd of a family body, its gradient in the parameters by one adjoint solve, and status.

    The products of the status are those of both solves. The gradient is good to three digits, and
    NaN where the adjoint did not converge.
    """
    case = steady.prepare(domain, family_markers(parameters, domain.nodes), reynolds)
    state, info = steady.body_flow(domain, case)
    gradient, cost = drag_slope(domain, case, state, parameters, ADJOINT)
    gradient = jnp.where(cost.converged, gradient, jnp.nan)
    info = info._replace(products=info.products + cost.products)
    return drag_coefficient(state.amplitude), gradient, info


def solve_with_continuation(
    domain: Domain, markers: Float[AnyArray, "nodes 2"], reynolds: float, halvings: int = 3
) -> Solution:
    """``solve``; where Newton from the Oseen flow fails, approach Re from below in 2, 4, 8 steps.

    The work of all attempts is counted, their preparations included.

    Raises:
      NotConverged: the flow was not found; no number is returned.
    """
    spent = 0
    for depth in range(halvings + 1):
        guess, steps = None, 2**depth
        for k in range(1, steps + 1):
            solution = solve(domain, markers, jnp.asarray(reynolds * k / steps), guess)
            spent += int(solution.info.products) + steady.preparation_cost(domain)
            if not bool(solution.info.converged):
                break
            guess = solution.state
        else:
            return solution._replace(info=solution.info._replace(products=jnp.asarray(spent)))
    raise NotConverged(
        f"body flow at Re {reynolds:g} did not converge: residual "
        f"{float(solution.info.residual):.1e} after {int(solution.info.steps)} Newton steps; "
        "more cells or a lower Re would help"
    )


@dataclasses.dataclass(frozen=True)
class DragReport:
    """One line of ``solve_drag``: coefficients, cost, and the gradient where it was asked."""

    reynolds: float
    cd: float
    cd_pressure: float
    cd_friction: float
    cl: float
    cm: float
    converged: bool
    iterations: int
    green_applications: int
    wall_s: float
    gradient: dict[str, float] | None = None


def body_domain(
    stream: Stream,
    fidelity: Fidelity,
    markers: Float[AnyArray, "nodes 2"],
    symmetric: bool,
    reynolds: float,
) -> Domain:
    """Domain for one body, its box rounded up so that similar bodies share compiled code.

    The window is as long as the wake at this Re asks for.

    Raises:
      InvalidInput: the body is thinner than the grid resolves, or does not fit the stream.
    """
    thickness = mean_thickness(markers) * fidelity.cells
    if thickness < THINNEST:
        needed = math.ceil(fidelity.cells * THINNEST / thickness)
        raise InvalidInput(
            f"body: its mean thickness is {thickness:.1f} cells and at least {THINNEST:g} are "
            f"needed; --cells {needed} would resolve it"
        )
    reach = np.abs(markers).max(axis=0) * 2
    fidelity = fidelity.reaching(reynolds, float(reach[1]))
    reach = np.ceil(reach * 4) / 4
    check_stream(stream, fidelity, reach)
    return make_domain(stream, fidelity, (float(reach[0]), float(reach[1])), symmetric)


def report(
    domain: Domain,
    markers: Float[AnyArray, "nodes 2"],
    reynolds: float,
    parameters: AnyArray | None = None,
) -> DragReport:
    """Solve and report; ``parameters`` (family bodies) asks for the gradient as well.

    ``green_applications`` are those of the drag, the gradient's left out.

    Raises:
      InvalidInput: the body reaches out of the domain's box.
      NotConverged: as ``solve_with_continuation``.
    """
    half = np.array(domain.box) / 2 * domain.lattice.step
    if np.any(np.abs(markers).max(axis=0) > half - 2 * np.array(domain.lattice.step)):
        raise InvalidInput("body: reaches beyond the bodies that this domain was made for")
    start = time.perf_counter()
    solution = solve_with_continuation(domain, jnp.asarray(markers), reynolds)
    gradient = None
    if parameters is not None:
        _, (shape, slope), info = family_drag_and_gradient(
            domain,
            jnp.asarray(parameters),
            jnp.asarray(reynolds, float),
            guess=solution.state,
        )
        if not (bool(info.converged) and np.all(np.isfinite([*shape, slope]))):
            raise NotConverged(f"adjoint flow at Re {reynolds:g} did not converge")
        gradient = dict(zip(PARAMETERS, map(float, shape), strict=True)) | {
            "reynolds": float(slope)
        }
    c = solution.coefficients
    return DragReport(
        reynolds=reynolds,
        cd=float(c.drag),
        cd_pressure=float(c.drag_pressure),
        cd_friction=float(c.drag_friction),
        cl=float(c.lift),
        cm=float(c.moment),
        converged=True,
        iterations=int(solution.info.steps),
        green_applications=int(solution.info.products),
        wall_s=time.perf_counter() - start,
        gradient=gradient,
    )
