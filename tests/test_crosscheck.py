"""Drag, lift and moment by ways that share no code: traction, momentum through a box, wake."""

import pytest
from crosscheck import drag_by_wake, loads_by_momentum

from surrogate import Flow, Scene, family_shape

CASES = {
    "cylinder": (family_shape({"aspect": 1.0}), 40.0, "unbounded"),
    "low Re": (family_shape({"aspect": 1.0}), 0.5, "unbounded"),
    "tunnel": (family_shape({"aspect": 2.0, "beta2": 0.1}), 20.0, "tunnel:8"),
    "incidence": (family_shape({"aspect": 2.0}, 20.0), 20.0, "unbounded"),
    "incidence in a narrow tunnel": (family_shape({"aspect": 2.0}, 20.0), 20.0, "tunnel:4"),
}


def solved(shape, reynolds, stream):
    """Return the solution, its whole lattice and its perturbation velocity there."""
    found = Flow(Scene(stream=stream)).solve(shape, reynolds, estimate=False)
    lattice = found.domain.lattice
    return found, lattice.unfolded, lattice.unfold(found.state.velocity)


@pytest.mark.parametrize("case", CASES)
def test_momentum_through_a_box_gives_the_loads(case):
    """The moment's tolerance is the retraction of the wall friction's lever arm, of order h."""
    found, lattice, velocity = solved(*CASES[case])
    drag, lift, moment = loads_by_momentum(lattice, velocity, found.reynolds, (1.8, 1.7))
    assert drag == pytest.approx(found.drag, rel=1e-3)
    assert lift == pytest.approx(found.lift, abs=1e-3 * drag)
    assert moment == pytest.approx(found.moment, abs=1.5e-3 * drag)
    if "incidence" in case:
        assert min(found.lift, found.moment) > 0.1 * found.drag


def test_wake_survey_gives_the_drag():
    """In a tunnel that is gridded from wall to wall, so that nothing is missing at its sides."""
    found, lattice, velocity = solved(CASES["cylinder"][0], 40.0, "tunnel:8")
    for station in (4.0, 7.0):
        drag = drag_by_wake(lattice, velocity, 40.0, station)
        assert drag == pytest.approx(found.drag, rel=0.01)
