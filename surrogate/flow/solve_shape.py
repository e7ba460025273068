"""One flow solved with everything that is known of it: loads, fields, gradients, its error."""

import time

from surrogate.body.shape import Shape
from surrogate.flow.check.error_estimate import ErrorEstimate, estimate_error
from surrogate.flow.check.error_model import Loads
from surrogate.flow.continuation import solve_by_continuation
from surrogate.flow.derivatives import named_gradients
from surrogate.flow.discrete import DiscreteBodies
from surrogate.flow.grid.discretise import fewest_cells, fitted_domain
from surrogate.flow.grid.domain import Domain
from surrogate.flow.loads import LOADS, drag, load_values
from surrogate.flow.solution import Solution
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.surface.coefficients import force_coefficients
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.scene import Scene


def solve_shape(
    scene: Scene,
    settings: NewtonSettings,
    shape: Shape,
    reynolds: float,
    domain: Domain,
    fidelity: Fidelity,
    gradient: bool = False,
    estimate: bool = True,
) -> Solution:
    """Solve the flow past one body: force coefficients, fields, work and estimated error.

    Args:
      scene: that names the stream and the tolerance.
      settings: tolerances of the Newton solver.
      shape: the body, which the scene, the Reynolds number and the domain admit.
      reynolds: U D / nu.
      domain: on which the flow is solved.
      fidelity: of that domain.
      gradient: compute the loads' derivatives by parameters and Re as well.
      estimate: estimate the error, by flows on one coarser grid and another domain.

    Raises:
      NotConverged: the flow, or the adjoint that the gradient needs, did not converge.
    """
    start = time.perf_counter()
    found, work = solve_by_continuation(domain, settings, shape, reynolds)
    seconds = time.perf_counter() - start
    force = force_coefficients(domain, shape.markers(domain.nodes), found.state, reynolds)
    force = {name: float(value) for name, value in force._asdict().items()}
    gradients = None
    if gradient:
        bodies = DiscreteBodies(domain, shape.body_class, settings)
        differentiated = {"cd": drag} if shape.symmetric else LOADS
        gradients = named_gradients(bodies, differentiated, shape.values, reynolds, found.state)
    error = ErrorEstimate()
    if estimate:
        loads = Loads(force["drag"], force["lift"], force["moment"])
        error = _estimated_error(scene, settings, shape, reynolds, fidelity, loads)
    return Solution(
        reynolds=reynolds,
        **force,
        **error._asdict(),
        tolerance=scene.fidelity.tolerance,
        green_applications=work,
        newton_steps=int(found.info.steps),
        seconds=seconds,
        gradients=gradients,
        shape=shape,
        domain=domain,
        state=found.state,
    )


def _estimated_error(scene, settings, shape, reynolds, fidelity, loads):
    def solve(fidelity: Fidelity) -> Loads:
        domain = fitted_domain(scene.stream, fidelity, shape, reynolds)
        found, _ = solve_by_continuation(domain, settings, shape, reynolds)
        at = found.state.amplitude, shape.markers(domain.nodes)
        return Loads(*load_values(domain.modes, tuple(LOADS.values()), *at).tolist())

    at = reynolds, shape.height, shape.dimension, shape.nose, fewest_cells(shape)
    return estimate_error(loads, solve, fidelity, *at)
