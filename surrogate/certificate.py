"""A prediction checked by the flow equations, for a fraction of what a flow costs."""

import functools
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body import check_family, family_markers, family_shape
from surrogate.flow import steady
from surrogate.flow.domain import Domain
from surrogate.flow.drag import report
from surrogate.flow.far import refinement
from surrogate.flow.forces import drag_coefficient
from surrogate.flow.immersed import Spreading, spread_modes
from surrogate.flow.lattice import Lattice
from surrogate.flow.oseen import oseen_kernel
from surrogate.flow.steady import Case, FlowState
from surrogate.flow.trust import fitted_domain
from surrogate.network import DragNetwork
from surrogate.reduced import Fields, ReducedFlow, stored_lattice
from surrogate.scene import check_reynolds
from surrogate.store import Surrogate
from surrogate.training.physics import Samples, scene_domain

ENOUGH = 3e-5  # relative change of the corrected drag in a sweep, below which none follows
MOST = 7  # sweeps
SETTLED = 1e-3  # relative change in the last sweep beyond which the body flow is solved
By = Literal["reduced flow", "body flow"]


class Certificate(NamedTuple):
    """Corrected drag, the relative error that it implies for the prediction, and how it was got.

    By a reduced flow there are also the relative change of the corrected drag in the last sweep,
    and the slip that the predicted traction leaves on the wall (rms over the modes, in U).
    """

    cd_corrected: float
    estimated_error: float
    remaining_error: float | None
    slip: float | None
    certificate_green_applications: int
    by: By


def certify(
    surrogate: Surrogate,
    parameters: AnyArray,
    reynolds: float,
    reduced: ReducedFlow | None = None,
) -> Certificate:
    """Correct a predicted drag: by a reduced flow where it may be trusted, else by a body flow.

    The reduced flow must be of the surrogate's scene, the body inside the trained ranges, and the
    correction settled. Outside the ranges the body flow is solved on a grid that fits the body.

    Raises:
      InvalidInput: no such body or Reynolds number, or the body does not fit the scene's grid.
      NotConverged: the flow was not found.
    """
    check_family(parameters)
    check_reynolds(reynolds, allow_unsteady=True)
    scene = surrogate.scene
    body, re = jnp.asarray(parameters, float), jnp.asarray(reynolds, float)
    domain, spent = scene_domain(scene), 0
    fits = reduced is not None and reduced.scene == scene
    if fits and surrogate.knows(parameters, reynolds):
        one = Samples(body[None], re[None])
        guess = jax.tree.map(lambda leaf: jnp.asarray(leaf[0]), reduced.guess(one))
        check = reduced_correction(domain, surrogate.network, guess, body, re)
        if float(check.remaining) <= SETTLED and float(check.corrected) > 0:
            return Certificate(
                float(check.corrected),
                abs(float(check.predicted / check.corrected) - 1),
                float(check.remaining),
                float(check.slip),
                int(check.products),
                "reduced flow",
            )
        spent = int(check.products)
    shape = family_shape(parameters)
    if not surrogate.knows(parameters, reynolds):
        domain = fitted_domain(shape, scene.stream, scene.fidelity, reynolds)
    solved = report(domain, shape.draw(domain.nodes), reynolds)
    error = abs(float(surrogate.drag(body, re)) / solved.cd - 1)
    return Certificate(solved.cd, error, None, None, solved.green_applications + spent, "body flow")


class Correction(NamedTuple):
    """Drags, relative change of the corrected one in the last sweep, rms slip, work."""

    corrected: Float[Array, ""]
    predicted: Float[Array, ""]
    remaining: Float[Array, ""]
    slip: Float[Array, ""]
    products: Array


@functools.partial(jax.jit, static_argnums=0)
def reduced_correction(
    domain: Domain,
    network: DragNetwork,
    guess: Fields,
    parameters: Float[AnyArray, " parameters"],
    reynolds: Float[AnyArray, ""],
    enough: float = ENOUGH,
) -> Correction:
    """The drag that a coupled Newton step would remove, the adjoint being known beforehand.

    A step of Newton's method on F(x) = 0, x = (u', a), changes the drag by lambda . F with
    A^T lambda = -dCd/dx: to second order in the error of x, times that of lambda. With
    lambda_u = C'(u)^T mu - S^T lambda_a, mu guessed and lambda_a from the no-slip condition of the
    adjoint, lambda . F = lambda_a . slip(u' - F_u) + mu . C'(u) F_u. Sweeps
    u' <- G(B a + C(u')) + far, a <- a - K^-1 slip, K = S G B, make x better until the drag moves by
    less than ``enough``, relatively. One application of G a sweep and one for its change of a, one
    for lambda_a; K lives on the body's box, leaves out the far field, and is counted as one more.
    (Giles & Pierce 2000, adjoint error correction.)
    """
    refine = refinement(domain.lattice, stored_lattice(domain.lattice))
    velocity, adjoint, far = (refine(field) for field in guess)
    kernel = oseen_kernel(domain.lattice, reynolds, domain.height)
    markers = family_markers(parameters, domain.nodes)
    body = spread_modes(domain.lattice, domain.modes, domain.box, markers)
    case = Case(kernel, far[None], body, jnp.zeros((0, *velocity.shape)))
    inverse = jnp.linalg.inv(box_compliance(domain, body, reynolds) + steady.pinning(domain, case))
    window = domain.lattice.cutoff()

    def convect(velocity):
        return domain.lattice.convect(window * velocity)

    def adjoint_traction(state):
        goal = jnp.zeros_like(state.amplitude).at[0].set(2.0)
        source = jax.vjp(convect, state.velocity)[1](adjoint)[0]
        respond = functools.partial(_flow_of_amplitude, domain, case, state.velocity)
        return inverse.T @ (goal - jax.vjp(respond, state.amplitude)[1](source)[0])

    predicted = network(parameters, reynolds)
    start = FlowState(velocity, predicted)
    weights = adjoint_traction(start)

    def assess(state):
        """The flow swept once, its slip, and the drag corrected at ``state``."""
        miss = steady.flow_residual(domain, case, state)
        swept = state._replace(velocity=state.velocity - miss)
        slip = steady.slip_residual(domain, case, swept)
        curved = jax.jvp(convect, (state.velocity,), (miss,))[1]
        change = weights @ slip + jnp.sum(adjoint * curved)
        return swept, slip, drag_coefficient(state.amplitude) + change

    def again(carry):
        (swept, slip, before), _, sweeps = carry
        step = -inverse @ slip
        push = kernel(body.spread(step))
        found = assess(FlowState(swept.velocity + push, swept.amplitude + step))
        return found, jnp.abs(before / found[2] - 1), sweeps + 1

    def unsettled(carry):
        _, moved, sweeps = carry
        return (moved > enough) & (sweeps < MOST)

    first = assess(start)
    (_, _, corrected), moved, sweeps = jax.lax.while_loop(unsettled, again, (first, jnp.inf, 1))
    return Correction(
        corrected,
        drag_coefficient(predicted),
        moved,
        jnp.sqrt(jnp.mean(first[1] ** 2)),
        2 * sweeps + 1,
    )


def box_compliance(
    domain: Domain, body: Spreading, reynolds: Float[AnyArray, ""]
) -> Float[Array, "modes modes"]:
    """K = S G B, the Oseen slip of every mode, from G on the body's box alone."""
    length, rows = body.density.shape[2:]
    lattice = domain.lattice
    box = Lattice((length, rows), lattice.step, length // 2, symmetric=lattice.symmetric)
    kernel = oseen_kernel(box, reynolds, domain.height)
    answers = jax.vmap(kernel)(body.density)
    return body.area * jnp.tensordot(body.density, answers, axes=([1, 2, 3], [1, 2, 3]))


def _flow_of_amplitude(domain, case, velocity, amplitude):
    return steady.flow_residual(domain, case, FlowState(velocity, amplitude))
