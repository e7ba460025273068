"""The flow: golden drags, order of convergence, exact symmetries and moments, robustness."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TINY
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from surrogate import (
    FIDELITIES,
    Family,
    Fidelity,
    Flow,
    InvalidInput,
    NotConverged,
    Scene,
    Shape,
    Tunnel,
    Unbounded,
    contour_shape,
    family_shape,
    naca4,
)
from surrogate.body.family import opening
from surrogate.flow.flow import _solve
from surrogate.flow.grid.domain import make_domain
from surrogate.flow.loads.forces import coefficients
from surrogate.flow.solver import steady
from surrogate.flow.solver.newton import NewtonSettings

CYLINDER = family_shape({"aspect": 1.0})
PLATE = family_shape({"aspect": 0.5})

# body-fitted finite elements, far field removed, uncertainty about 1e-4
UNBOUNDED = {1.0: 10.335, 5.0: 3.930, 10.0: 2.754, 20.0: 1.999, 40.0: 1.497}
TUNNEL = {
    (16.0, 1.0): 13.743,
    (16.0, 10.0): 3.072,
    (16.0, 40.0): 1.625,
    (8.0, 1.0): 18.412,
    (8.0, 10.0): 3.548,
    (8.0, 40.0): 1.841,
}


def solve(shape, reynolds, fidelity="standard", stream="unbounded"):
    flow = Flow(Scene(stream=stream, fidelity=fidelity))
    return flow.solve(shape, reynolds, estimate=False)


def moved(shape, dx, dy):
    """The same body elsewhere."""
    return Shape(lambda nodes: shape.draw(nodes) + np.array([dx, dy]), shape.symmetric and dy == 0)


@pytest.mark.parametrize("reynolds", UNBOUNDED)
def test_golden_unbounded_cylinder(reynolds):
    assert solve(CYLINDER, reynolds).drag == pytest.approx(UNBOUNDED[reynolds], rel=0.0025)


@pytest.mark.parametrize(("height", "reynolds"), TUNNEL)
def test_golden_tunnel_cylinder(height, reynolds):
    drag = solve(CYLINDER, reynolds, "draft", Tunnel(height)).drag
    assert drag == pytest.approx(TUNNEL[height, reynolds], rel=0.012)


def test_golden_split_of_the_cylinders_drag():
    found = solve(CYLINDER, 1.0)
    assert found.drag_pressure == pytest.approx(5.22, rel=0.04)
    assert found.drag_friction == pytest.approx(5.11, rel=0.04)
    assert found.surface().pressure_drag == pytest.approx(5.22, rel=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("reynolds", UNBOUNDED)
def test_golden_fine_grid_is_within_a_thousandth(reynolds):
    drag = solve(CYLINDER, reynolds, "fine").drag
    assert drag == pytest.approx(UNBOUNDED[reynolds], rel=0.001)


def test_order_of_the_drag_in_a_tunnel():
    """A cylinder between walls, where no window is cut off across: nothing of first order."""
    cells = (8, 12, 18)
    errors = [
        solve(CYLINDER, 1.0, Fidelity("", n, 3, 5, 8), Tunnel(8.0)).drag / 18.412 - 1 for n in cells
    ]
    coarse, fine = np.array(errors[:2]), np.array(errors[1:])
    limit = np.mean((fine * 1.5**2 - coarse) / (1.5**2 - 1))
    rates = np.log(np.abs(coarse - limit) / np.abs(fine - limit)) / np.log(1.5)
    assert abs(limit) < 5e-4, f"errors {errors}, limit {limit}"
    assert min(rates) > 1.8, f"errors {errors}, limit {limit}, rates {rates}"


def test_order_of_the_drag_of_a_slender_body():
    """Window fixed; errors against a fine grid of the same window."""
    body = family_shape({"aspect": 3.0, "beta2": -0.2, "beta3": 0.1, "beta4": 0.05})

    def drag(cells):
        return solve(body, 5.0, Fidelity("", cells, 2.5, 3.5, 4)).drag

    exact = drag(40)
    errors = [abs(drag(cells) / exact - 1) for cells in (8, 12, 18)]
    rates = [np.log(a / b) / np.log(1.5) for a, b in itertools.pairwise(errors)]
    assert min(rates) > 1.6, f"errors {errors}, rates {rates}"


def test_any_tunnel_height_fits_the_grid():
    """Rows shrink a little where the height is no multiple of a cell: the drag stays smooth."""
    below, middle, above = (
        solve(CYLINDER, 10.0, "draft", Tunnel(height)).drag for height in (7.9, 8.0, 8.1)
    )
    assert below > middle > above
    assert abs(below - 2 * middle + above) < 0.2 * (below - above)


@pytest.mark.parametrize("stream", [Unbounded(), Tunnel(8.0)])
def test_exact_lift_of_the_mirrored_body(stream):
    wing = contour_shape(naca4("4418"), 10.0)
    mirror = Shape(lambda nodes: np.roll((wing.draw(nodes) * [1, -1])[::-1], 1, axis=0), False)
    a, b = (solve(shape, 20.0, "draft", stream) for shape in (wing, mirror))
    assert a.lift > 0.5
    assert a.lift == pytest.approx(-b.lift, rel=1e-9)
    assert a.drag == pytest.approx(b.drag, rel=1e-9)


ROOMY = make_domain(Unbounded(), TINY, (2.5, 2.5), symmetric=False)


def forces_in_room(shape, reynolds):
    markers = jnp.asarray(shape.draw(ROOMY.nodes))
    found = _solve(ROOMY, NewtonSettings(1e-10), markers, jnp.asarray(reynolds))
    assert bool(found.info.converged)
    return found.forces


def test_exact_moment_turns_an_ellipse_across_the_stream():
    """At incidence the moment is nose up, and the mirror image has the opposite one."""
    up, down = (
        float(forces_in_room(family_shape({"aspect": 2.0}, incidence), 20.0).moment)
        for incidence in (20.0, -20.0)
    )
    assert up > 0.1
    assert up == pytest.approx(-down, rel=1e-9)


def test_exact_moment_of_a_known_traction():
    """A couple f on a circle of radius 1/2 turns it by pi f: nose up, since it runs clockwise."""
    t = 2 * np.pi * np.arange(ROOMY.nodes) / ROOMY.nodes
    couple = 0.3 * np.stack([np.sin(t), np.cos(t)])  # of the fluid on the body, per unit t
    modes = np.asarray(ROOMY.modes.values(ROOMY.nodes)).reshape(ROOMY.modes.count, -1)
    amplitude = np.linalg.lstsq(modes.T, -couple.ravel(), rcond=None)[0]
    assert np.allclose(modes.T @ amplitude, -couple.ravel(), atol=1e-12)
    stream = jnp.zeros((2, *ROOMY.lattice.shape))
    markers = jnp.asarray(CYLINDER.draw(ROOMY.nodes))
    found = coefficients(ROOMY, markers, stream, jnp.asarray(amplitude), jnp.asarray(1.0))
    assert float(found.moment) == pytest.approx(2 * np.pi * 0.3, rel=1e-12)
    assert float(found.drag) == pytest.approx(0, abs=1e-12)
    assert float(found.lift) == pytest.approx(0, abs=1e-12)


def test_exact_moment_about_another_point():
    """Creeping flow, whole cells aside: the forces stay, the moment gains Cd dy - Cl dx."""
    dx, dy = 3 / TINY.cells, -2 / TINY.cells
    body = family_shape({"aspect": 2.0, "beta2": 0.2}, 30.0)
    here, there = (forces_in_room(shape, 1e-3) for shape in (body, moved(body, dx, dy)))
    assert float(there.drag) == pytest.approx(float(here.drag), rel=1e-4)
    assert float(there.lift) == pytest.approx(float(here.lift), rel=2e-3)
    gained = float(there.moment - here.moment)
    expected = float(here.drag * dy - here.lift * dx)
    assert abs(expected) > 0.05 * float(here.drag)
    assert gained == pytest.approx(expected, rel=2e-3)


def test_drag_does_not_jitter_as_the_body_moves_through_the_grid():
    h = 1 / FIDELITIES["standard"].cells
    drags = [
        solve(moved(CYLINDER, h * (1 + shift), 0.0), 20.0).drag for shift in (0, 0.25, 0.5, 0.75, 1)
    ]
    drift = np.polyval(np.polyfit(np.arange(5), drags, 1), np.arange(5))  # farther from the inlet
    jitter = np.abs(drags - drift).max() / drags[0]
    assert jitter < 5e-4, f"jitter {jitter:.1e}, drags {drags}"


def test_drag_does_not_jitter_as_a_flat_side_moves_through_the_rows():
    """Half a cell sideways; without the ripple of the retraction this is 4e-4."""
    ellipse = family_shape({"aspect": 16 / 9})  # 12 cells high
    domain = make_domain(Unbounded(), FIDELITIES["standard"], (1.75, 1.25), symmetric=False)
    here, there = (
        _solve(
            domain, NewtonSettings(), jnp.asarray(shape.draw(domain.nodes)), jnp.asarray(20.0)
        ).forces.drag
        for shape in (ellipse, moved(ellipse, 0.0, 0.5 / 16))
    )
    assert float(there) == pytest.approx(float(here), rel=1e-4)


def test_exact_uniform_pressure_moves_nothing(cylinder_domain):
    markers = jnp.asarray(CYLINDER.draw(cylinder_domain.nodes))
    prepare = jax.jit(steady.prepare, static_argnames="domain")
    case = prepare(cylinder_domain, markers, jnp.asarray(10.0))
    pushed = jnp.tensordot(case.body.silent, case.response, axes=1)
    typical = float(jnp.abs(case.response[0]).max())
    assert float(jnp.abs(pushed).max()) < 0.02 * typical
    assert float(jnp.abs(case.body.slip(pushed)).max()) < 1e-3 * typical


def test_status_says_when_newton_stops_early(cylinder_domain):
    markers = jnp.asarray(CYLINDER.draw(cylinder_domain.nodes))
    hasty = NewtonSettings(tolerance=1e-10, max_steps=1)
    info = _solve(cylinder_domain, hasty, markers, jnp.asarray(40.0)).info
    assert not bool(info.converged)
    assert int(info.steps) == 1


def test_a_flow_that_is_not_found_raises():
    with pytest.raises(NotConverged, match="Re 250 did not converge"):
        Flow(Scene(fidelity=TINY)).solve(PLATE, 250.0, allow_unsteady=True, estimate=False)


def test_a_body_beyond_the_grid_of_a_scene_is_refused(tiny_scene):
    with pytest.raises(InvalidInput, match="reaches beyond"):
        Flow(tiny_scene).solve(np.array([0.3, 0.0, 0.0, 0.0]), 1.0)
    with pytest.raises(InvalidInput, match="reaches beyond"):
        Flow(tiny_scene).drag(np.array([0.3, 0.0, 0.0, 0.0]), 1.0)


def test_thin_and_large_bodies_are_refused():
    with pytest.raises(InvalidInput, match="cells per D would resolve it"):
        solve(family_shape({"aspect": 18.0}), 1.0, "draft")
    large = contour_shape(6 * CYLINDER.draw(400), keep_size=True)
    with pytest.raises(InvalidInput, match="too large"):
        solve(large, 1.0, "draft")
    with pytest.raises(InvalidInput, match="tunnel"):
        solve(CYLINDER, 1.0, "draft", Tunnel(1.5))


SMALL = Scene(reynolds=(0.5, 45), fidelity=Fidelity("", 8, 2.5, 4, 5, 5))
BODIES = st.tuples(*(st.floats(*ends) for ends in Family().bounds.tolist()))


def test_nothing_recompiles_for_another_body(compiled):
    """Nor for the same scene written again."""

    def every_way(flow, body, reynolds):
        flow.drag(body, reynolds)
        flow.solve(body, reynolds, estimate=False)
        flow.labels(np.stack([body, body]), np.array([reynolds, reynolds]))

    every_way(Flow(SMALL), np.array([2.0, 0.1, 0.0, 0.0]), 10.0)
    assert len(compiled) >= 3
    compiled.clear()
    every_way(Flow(SMALL), np.array([3.0, -0.1, 0.05, 0.02]), 17.0)
    every_way(Flow(dataclasses.replace(SMALL)), np.array([1.5, 0.0, 0.0, 0.0]), 40.0)
    assert compiled == []


@settings(max_examples=25, deadline=None, derandomize=True)
@given(BODIES, st.floats(0.5, 45.0))
def test_robust_any_body_of_the_family_has_a_sane_drag(parameters, reynolds):
    body = np.asarray(parameters)
    assume(float(opening(body, Family().modes)) >= 0.05)
    cylinder = 2.0 + 10.0 / reynolds
    assert 0.3 * cylinder < float(Flow(SMALL).drag(body, reynolds)) < 2.5 * cylinder
