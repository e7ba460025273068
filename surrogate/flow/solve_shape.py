"""One flow solved with everything that is known of it: loads, fields, gradients, its error."""

import dataclasses
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
from surrogate.scene.limits import onset_of
from surrogate.scene.scene import Scene


def solve_shape(
    scene: Scene,
    settings: NewtonSettings,
    shape: Shape,
    reynolds: float,
    domain: Domain,
    fidelity: Fidelity,
    gradient: bool = False,
) -> Solution:
    """Solve the flow past one body: force coefficients, fields and work.

    Args:
      scene: that names the stream and the tolerance.
      settings: tolerances of the Newton solver.
      shape: the body, which the scene, the Reynolds number and the domain admit.
      reynolds: U D / nu.
      domain: on which the flow is solved.
      fidelity: of that domain.
      gradient: compute the loads' derivatives by parameters and Re as well.

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
    return Solution(
        reynolds=reynolds,
        **force,
        **ErrorEstimate()._asdict(),
        tolerance=scene.fidelity.tolerance,
        fidelity=fidelity,
        green_applications=work,
        newton_steps=int(found.info.steps),
        seconds=seconds,
        gradients=gradients,
        shape=shape,
        domain=domain,
        state=found.state,
    )


def with_estimate(scene: Scene, settings: NewtonSettings, solution: Solution) -> Solution:
    """Return a solution with an estimate of its error, by a coarser grid and another domain.

    Args:
      scene: in which the flow was solved.
      settings: tolerances of the Newton solver.
      solution: of one body.
    """
    shape, reynolds = solution.shape, solution.reynolds

    def solve(fidelity: Fidelity) -> Loads:
        domain = fitted_domain(scene.stream, fidelity, shape, reynolds)
        found, _ = solve_by_continuation(domain, settings, shape, reynolds)
        at = found.state.amplitude, shape.markers(domain.nodes)
        return Loads(*load_values(domain.modes, tuple(LOADS.values()), *at).tolist())

    loads = Loads(solution.drag, solution.lift, solution.moment)
    error = estimate_error(
        loads,
        solve,
        solution.fidelity,
        reynolds,
        height=shape.height,
        dimension=shape.dimension,
        nose=shape.nose,
        onset=onset_of(shape),
        fewest=fewest_cells(shape),
        flatness=(shape.parameters or {}).get("flatness", 1.0),
    )
    return dataclasses.replace(solution, **error._asdict())
