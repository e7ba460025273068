"""Bodies between the slip walls of a tunnel, symmetric about its centre line or not."""

import itertools

import pytest

from surrogate import Flow, Scene, Shape, Tunnel, Unbounded, family_shape
from surrogate.flow.grid import domain_2d

ELLIPSE = family_shape({"aspect": 2.0})
HEIGHTS = (3.0, 6.0, 16.0, None)  # in D; None: no walls


def solve(shape, reynolds, height, fidelity="draft"):
    stream = Unbounded() if height is None else Tunnel(height)
    return Flow(Scene(stream=stream, fidelity=fidelity)).solve(shape, reynolds, estimate=False)


@pytest.mark.parametrize("reynolds", [1.0, 40.0])
@pytest.mark.parametrize("height", [3.0, 8.0])
def test_a_symmetric_body_has_one_drag_on_the_whole_and_on_half_the_tunnel(
    height, reynolds, monkeypatch
):
    """Solved without use of its symmetry, an ellipse has the same drag and no lift or moment."""
    monkeypatch.setattr(domain_2d, "LIFTING_HARMONICS", 1.0)  # as on the half
    monkeypatch.setattr(domain_2d, "LIFTING_FAR_ORDER", domain_2d.FAR_ORDER)
    half = solve(ELLIPSE, reynolds, height)
    whole = solve(Shape(ELLIPSE.draw, symmetric=False), reynolds, height)
    assert whole.drag == pytest.approx(half.drag, rel=1e-5)
    assert whole.lift == pytest.approx(0, abs=1e-4)
    assert whole.moment == pytest.approx(0, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("reynolds", [1.0, 20.0])
def test_walls_raise_drag_lift_and_moment_of_an_ellipse_at_incidence(reynolds):
    """They fall monotonically to those of the unbounded stream as the walls move away."""
    body = family_shape({"aspect": 2.0}, incidence=10.0)
    found = [solve(body, reynolds, height) for height in HEIGHTS]
    for name in ("drag", "lift", "moment"):
        values = [getattr(solution, name) for solution in found]
        assert values == sorted(values, reverse=True), f"{name}: {values}"
        assert values[-1] > 0
        assert values[0] > 1.3 * values[-1], f"{name}: {values}"


@pytest.mark.slow
def test_order_of_the_walls_effect_is_one_over_their_distance():
    """The excess over the unbounded flow halves, or a little more, as H is doubled."""
    body = family_shape({"aspect": 2.0}, incidence=10.0)
    free, *walled = (solve(body, 20.0, height) for height in (None, 16.0, 32.0, 64.0))
    for name in ("drag", "lift", "moment"):
        excess = [getattr(solution, name) - getattr(free, name) for solution in walled]
        ratios = [near / far for near, far in itertools.pairwise(excess)]
        assert 2.0 < ratios[1] < ratios[0] < 2.7, f"{name}: excess {excess}, ratios {ratios}"
