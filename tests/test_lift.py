"""Lift and moment of bodies at incidence: golden values, symmetries, sign, surface loads."""

import jax.numpy as jnp
import numpy as np
import pytest

from surrogate import Fidelity, Flow, Scene, family_shape
from surrogate.flow.grid.wall_2d import outward

# ellipse of aspect 2 at 10 degrees, body-fitted finite elements, uncertainty 3e-4 of Cd: Cd, Cl
ELLIPSE = {1.0: (9.966, 0.4058), 20.0: (1.7517, 0.3057)}
STANDARD, DRAFT = Flow(Scene()), Flow(Scene(fidelity="draft"))


def solve(incidence, reynolds, aspect=2.0, flow=STANDARD):
    return flow.solve(family_shape({"aspect": aspect}, incidence), reynolds, estimate=False)


@pytest.fixture(scope="module", params=ELLIPSE)
def solution(request):
    """The ellipse at 10 degrees on the standard grid."""
    return solve(10.0, request.param)


def test_golden_drag_and_lift_of_an_ellipse(solution):
    """Both within a quarter per cent of the drag."""
    drag, lift = ELLIPSE[solution.reynolds]
    assert solution.drag == pytest.approx(drag, rel=0.0025)
    assert solution.lift == pytest.approx(lift, abs=0.0025 * drag)


@pytest.mark.parametrize("reynolds", ELLIPSE)
def test_golden_lift_on_a_finer_grid(reynolds):
    found = solve(10.0, reynolds, flow=Flow(Scene(fidelity=Fidelity("", 24, 6, 12, 8))))
    drag, lift = ELLIPSE[reynolds]
    assert found.drag == pytest.approx(drag, rel=0.002)
    assert found.lift == pytest.approx(lift, rel=0.006)


def test_reversed_incidence_reverses_lift_and_moment_and_keeps_the_drag(solution):
    reverse = solve(-10.0, solution.reynolds)
    assert reverse.drag == pytest.approx(solution.drag, rel=1e-7)
    assert reverse.lift == pytest.approx(-solution.lift, rel=1e-6)
    assert reverse.moment == pytest.approx(-solution.moment, rel=1e-6)


def test_the_moment_turns_an_ellipse_across_the_stream(solution):
    """Nose up at a positive incidence, as in potential flow, at any Reynolds number."""
    assert 0.01 * solution.drag < solution.moment < 0.2 * solution.drag


def test_pressure_and_friction_on_the_surface_add_up_to_lift_and_moment(solution):
    """Both are extrapolated from cells off the wall, so they are of first order in h."""
    surface = solution.surface()
    normal = np.asarray(outward(jnp.asarray(surface.markers))).T  # times ds/dt
    force = -surface.cp * normal + surface.cf * np.stack([normal[1], -normal[0]])
    (x, y), drag = surface.markers.T, solution.drag
    assert 2 * np.pi * force[1].mean() == pytest.approx(solution.lift, abs=0.01 * drag)
    moment = 2 * np.pi * np.mean(y * force[0] - x * force[1])
    assert moment == pytest.approx(solution.moment, abs=0.01 * drag)


def test_stations_of_the_surface_are_along_the_chord(solution):
    surface = solution.surface(64)
    along = (1 - np.cos(2 * np.pi * np.arange(64) / 64)) / 2
    np.testing.assert_allclose(surface.station, along, atol=1e-3)


def test_a_circle_has_the_same_drag_at_any_incidence_and_no_lift_or_moment():
    few, many = (solve(incidence, 20.0, aspect=1.0, flow=DRAFT) for incidence in (25.0, 70.0))
    assert few.drag == pytest.approx(many.drag, rel=1e-5)
    for value in (few.lift, few.moment, many.lift, many.moment):
        assert value == pytest.approx(0, abs=1e-5)


def test_an_ellipse_turned_by_90_degrees_is_that_of_inverse_aspect():
    turned, across = solve(100.0, 10.0, flow=DRAFT), solve(10.0, 10.0, aspect=0.5, flow=DRAFT)
    assert across.lift < -0.1
    for name in ("drag", "lift", "moment"):
        assert getattr(turned, name) == pytest.approx(getattr(across, name), rel=1e-5)


def test_lift_and_moment_are_odd_and_linear_at_small_incidence():
    """Twice the incidence gives twice the lift and moment; the rest is of third order."""
    small, double = (solve(incidence, 20.0) for incidence in (2.0, 4.0))
    assert double.lift == pytest.approx(2 * small.lift, rel=0.01)
    assert double.moment == pytest.approx(2 * small.moment, rel=0.01)
