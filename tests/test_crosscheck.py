"""The force by three ways that share no code: traction, momentum through a box, wake survey."""

import pytest
from crosscheck import drag_by_wake, force_by_momentum

from surrogate import Flow, Scene, family_shape

CASES = {
    "cylinder": (family_shape({"aspect": 1.0}), 40.0, "unbounded"),
    "creeping": (family_shape({"aspect": 1.0}), 0.5, "unbounded"),
    "tunnel": (family_shape({"aspect": 2.0, "beta2": 0.1}), 20.0, "tunnel:8"),
    "incidence": (family_shape({"aspect": 2.0}, 20.0), 20.0, "unbounded"),
}


def solved(shape, reynolds, stream):
    """The flow, and its velocity without the stream's own."""
    found = Flow(Scene(stream=stream)).solve(shape, reynolds, estimate=False)
    lattice = found.domain.lattice
    return found, lattice.unfolded, lattice.unfold(found.state.velocity)


@pytest.mark.parametrize("case", CASES)
def test_momentum_through_a_box_is_the_force(case):
    found, lattice, velocity = solved(*CASES[case])
    drag, lift = 2 * force_by_momentum(lattice, velocity, found.reynolds, (1.2, 1.0))
    assert drag == pytest.approx(found.drag, rel=2e-3)
    assert lift == pytest.approx(found.lift, abs=2e-3 * drag)


def test_wake_survey_is_the_drag():
    """In a tunnel that is gridded from wall to wall, so that nothing is missing at its sides."""
    found, lattice, velocity = solved(CASES["cylinder"][0], 40.0, "tunnel:8")
    for station in (4.0, 7.0):
        drag = drag_by_wake(lattice, velocity, 40.0, station)
        assert drag == pytest.approx(found.drag, rel=0.01)
