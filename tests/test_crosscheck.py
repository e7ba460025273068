"""The force by three ways that share no code: traction, momentum through a box, wake survey."""

import jax.numpy as jnp
import numpy as np
import pytest

from surrogate.body.family import family_shape
from crosscheck import drag_by_wake, force_by_momentum
from surrogate.flow.flow import body_domain, solve
from surrogate.scene.scene import FIDELITIES, Tunnel, Unbounded

CASES = {
    "cylinder": ((1.0, 0, 0, 0), 0.0, 40.0, Unbounded()),
    "creeping": ((1.0, 0, 0, 0), 0.0, 0.5, Unbounded()),
    "tunnel": ((2.0, 0.1, 0, 0), 0.0, 20.0, Tunnel(8.0)),
    "incidence": ((2.0, 0, 0, 0), 20.0, 20.0, Unbounded()),
}


def solved(parameters, incidence, reynolds, stream):
    fidelity = FIDELITIES["standard"]
    shape = family_shape(np.array(parameters), incidence)
    domain = body_domain(stream, fidelity, shape.draw(300), shape.symmetric, reynolds)
    markers = shape.draw(domain.nodes)
    solution = solve(domain, jnp.asarray(markers), jnp.asarray(reynolds))
    lattice = domain.lattice
    return solution, lattice.unfolded, lattice.unfold(solution.state.velocity)


@pytest.mark.parametrize("case", CASES)
def test_momentum_through_a_box_is_the_force(case):
    solution, lattice, velocity = solved(*CASES[case])
    drag, lift = 2 * force_by_momentum(lattice, velocity, CASES[case][2], (1.2, 1.0))
    assert drag == pytest.approx(float(solution.coefficients.drag), rel=2e-3)
    assert lift == pytest.approx(float(solution.coefficients.lift), abs=2e-3 * drag)


def test_wake_survey_is_the_drag():
    """In a tunnel that is gridded from wall to wall, so that nothing is missing at its sides."""
    solution, lattice, velocity = solved((1.0, 0, 0, 0), 0.0, 40.0, Tunnel(8.0))
    for station in (4.0, 7.0):
        drag = drag_by_wake(lattice, velocity, 40.0, station)
        assert drag == pytest.approx(float(solution.coefficients.drag), rel=0.01)
