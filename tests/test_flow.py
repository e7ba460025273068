"""The flow: golden drags, order of convergence, derivatives, symmetry, refusal to guess."""

import dataclasses
import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surrogate.body.family import Family, family_markers, opening, rotate
from surrogate.body.contour import naca4, smooth_contour
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.solver import steady, tangent
from surrogate.flow.grid.domain import make_domain
from surrogate.flow.flow import (
    body_domain,
    family_drag_and_gradient,
    family_drag_and_shape_gradient,
    report,
    solve,
)
from surrogate.flow.loads.forces import drag_coefficient
from surrogate.flow.solver.krylov import gmres
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.scene.scene import FIDELITIES, Fidelity, Scene, Tunnel, Unbounded
from surrogate.training.physics import scene_domain

CYLINDER = jnp.array([1.0, 0, 0, 0])
LENS = jnp.array([2.2, 0.12, -0.05, 0.03])

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


def cylinder_drag(stream, fidelity, reynolds):
    domain = make_domain(stream, fidelity, (1.25, 1.25), symmetric=True)
    solution = solve(domain, family_markers(CYLINDER, domain.nodes), jnp.asarray(reynolds))
    assert bool(solution.info.converged)
    return solution.coefficients


@pytest.mark.parametrize("reynolds", UNBOUNDED)
def test_golden_unbounded_cylinder(reynolds):
    drag = float(cylinder_drag(Unbounded(), FIDELITIES["standard"], reynolds).drag)
    assert drag == pytest.approx(UNBOUNDED[reynolds], rel=0.0025)


@pytest.mark.parametrize(("height", "reynolds"), TUNNEL)
def test_golden_tunnel_cylinder(height, reynolds):
    drag = float(cylinder_drag(Tunnel(height), FIDELITIES["draft"], reynolds).drag)
    assert drag == pytest.approx(TUNNEL[height, reynolds], rel=0.012)


def test_golden_split_of_the_cylinders_drag():
    c = cylinder_drag(Unbounded(), FIDELITIES["standard"], 1.0)
    assert float(c.drag_pressure) == pytest.approx(5.22, rel=0.04)
    assert float(c.drag_friction) == pytest.approx(5.11, rel=0.04)


def test_drag_converges_at_second_order_to_the_reference():
    """A cylinder in a tunnel, where no window is cut off across: nothing of first order is left."""
    cells = (8, 12, 18)
    errors = [
        float(cylinder_drag(Tunnel(8.0), Fidelity("", n, 3, 5, 8), 1.0).drag) / 18.412 - 1
        for n in cells
    ]
    coarse, fine = np.array(errors[:2]), np.array(errors[1:])
    limit = np.mean((fine * 1.5**2 - coarse) / (1.5**2 - 1))
    rates = np.log(np.abs(coarse - limit) / np.abs(fine - limit)) / np.log(1.5)
    assert abs(limit) < 5e-4, f"errors {errors}, limit {limit}"
    assert min(rates) > 1.8, f"errors {errors}, limit {limit}, rates {rates}"


def test_drag_converges_at_second_order_for_a_slender_body():
    """Window fixed; errors against a fine grid of the same window."""

    def drag(cells):
        domain = make_domain(Unbounded(), Fidelity("", cells, 2.5, 3.5, 4), (2.25, 1.0), True)
        body = family_markers(jnp.array([3.0, -0.2, 0.1, 0.05]), domain.nodes)
        return float(solve(domain, body, jnp.asarray(5.0)).coefficients.drag)

    exact = drag(40)
    errors = [abs(drag(cells) / exact - 1) for cells in (8, 12, 18)]
    rates = [np.log(a / b) / np.log(1.5) for a, b in itertools.pairwise(errors)]
    assert min(rates) > 1.6, f"errors {errors}, rates {rates}"


EXACT = NewtonSettings(tolerance=1e-10, linear_tolerance=1e-8)


@pytest.mark.parametrize("reynolds", [1.0, 40.0])
def test_quick_shape_gradient_has_three_digits(reynolds, cylinder_domain):
    domain = dataclasses.replace(cylinder_domain, box=(30, 24))
    re = jnp.asarray(reynolds)
    drag, (expected, _), _ = family_drag_and_gradient(domain, LENS, re, EXACT)
    quick, slope, info = family_drag_and_shape_gradient(domain, LENS, re)
    assert bool(info.converged)
    assert float(quick) == pytest.approx(float(drag), rel=1e-5)
    miss = float(jnp.linalg.norm(slope - expected) / jnp.linalg.norm(expected))
    assert miss < 2e-3, f"miss {miss:.1e}"


@pytest.mark.parametrize("reynolds", [1.0, 16.0, 40.0])  # at 16 a cell's Re is 2 exactly
def test_gradient_passes_the_taylor_test(reynolds, cylinder_domain):
    """Halve the step four times; the remainder must fall at second order, in shape and Re."""
    domain = dataclasses.replace(cylinder_domain, box=(30, 24))
    direction = np.array([0.4, 0.1, -0.08, 0.05, 0.3])

    def evaluate(step):
        moved = LENS + step * direction[:4]
        drag, (shape, slope), info = family_drag_and_gradient(
            domain, moved, jnp.asarray(reynolds + step * direction[4]), EXACT
        )
        assert bool(info.converged)
        return float(drag), float(shape @ direction[:4] + slope * direction[4])

    drag, slope = evaluate(0.0)
    steps = 0.1 / 2.0 ** np.arange(5)
    remainders = [abs(evaluate(step)[0] - drag - step * slope) for step in steps]
    rates = np.log2(np.array(remainders[:-1]) / remainders[1:])
    assert rates[-1] > 1.9, f"remainders {remainders}, rates {rates}"


def test_gradient_agrees_with_central_differences_over_a_sweep_of_steps(cylinder_domain):
    """The difference falls with the step squared until the solver's tolerance takes over."""
    domain = dataclasses.replace(cylinder_domain, box=(30, 24))
    evaluate = functools.partial(family_drag_and_gradient, domain, settings=EXACT)
    _, (shape, slope), _ = evaluate(LENS, jnp.asarray(10.0))
    for k, expected in enumerate([*shape, slope]):
        direction = jnp.zeros(5).at[k].set(1.0)

        def drag(step, direction=direction):
            return float(evaluate(LENS + step * direction[:4], 10.0 + step * direction[4])[0])

        errors = [
            abs((drag(h) - drag(-h)) / (2 * h) / float(expected) - 1) for h in (2e-2, 5e-3, 1e-3)
        ]
        assert errors[0] < 0.1, f"parameter {k}: {errors}"
        assert errors[1] < errors[0] / 10, f"parameter {k}: {errors}"
        assert errors[2] < 5e-4, f"parameter {k}: {errors}"


@pytest.fixture(scope="module")
def driven(cylinder_domain):
    """A flow driven by a traction that is not the body's."""
    case = jax.jit(
        lambda: steady.prepare(cylinder_domain, family_markers(CYLINDER, 96), 20.0 * jnp.ones(()))
    )()
    solved, _ = steady.body_flow(cylinder_domain, case)
    tight = NewtonSettings(tolerance=1e-11, linear_tolerance=1e-8)

    def slip(amplitude):
        velocity, _ = steady.forced_flow(cylinder_domain, case, amplitude, settings=tight)
        return steady.slip_residual(cylinder_domain, case, steady.FlowState(velocity, amplitude))

    amplitude = 0.9 * solved.amplitude
    velocity, info = steady.forced_flow(cylinder_domain, case, amplitude, settings=tight)
    assert bool(info.converged)
    return case, steady.FlowState(velocity, amplitude), jax.jit(slip)


TIGHT = tangent.Effort(1e-6, 60)


def test_compliance_is_the_derivative_of_the_slip(cylinder_domain, driven):
    case, state, slip = driven
    matrix, cost = tangent.compliance(cylinder_domain, case, state, TIGHT)
    assert bool(cost.converged)
    step = 1e-5 * np.linspace(1, -1, state.amplitude.size)
    difference = (slip(state.amplitude + step) - slip(state.amplitude - step)) / 2
    assert np.allclose(difference, matrix @ step, atol=1e-11)


def test_slip_adjoint_agrees_with_the_implicit_derivative(cylinder_domain, driven):
    case, state, slip = driven
    weights = jnp.linspace(-1, 2, state.amplitude.size)
    gradient, _ = tangent.slip_adjoint(cylinder_domain, case, state, weights, TIGHT)
    expected = jax.grad(lambda a: weights @ slip(a))(state.amplitude)
    assert np.allclose(gradient, expected, rtol=1e-5, atol=1e-6)


def test_drag_weights_predict_the_newton_step(cylinder_domain, driven):
    """lambda . y is the drag that one coupled step removes, for the flow a traction drives."""
    case, state, _ = driven
    weights, _ = tangent.drag_weights(cylinder_domain, case, state, TIGHT)
    moved, _ = tangent.coupled_step(cylinder_domain, case, state, TIGHT)
    change = drag_coefficient(moved.amplitude) - drag_coefficient(state.amplitude)
    slip = steady.slip_residual(cylinder_domain, case, state)
    assert float(weights @ slip) == pytest.approx(float(change), rel=1e-5)


def test_uniform_pressure_moves_nothing(cylinder_domain):
    case = steady.prepare(cylinder_domain, family_markers(CYLINDER, 96), jnp.asarray(10.0))
    pushed = jnp.tensordot(case.body.silent, case.response, axes=1)
    typical = float(jnp.abs(case.response[0]).max())
    assert float(jnp.abs(pushed).max()) < 0.02 * typical
    assert float(jnp.abs(case.body.slip(pushed)).max()) < 1e-3 * typical


@pytest.mark.parametrize("stream", [Unbounded(), Tunnel(8.0)])
def test_mirrored_body_has_the_mirrored_lift(stream):
    fidelity = FIDELITIES["draft"]
    markers = np.asarray(rotate(jnp.asarray(smooth_contour(naca4("4418"), 200)), 10.0))
    domain = body_domain(stream, fidelity, markers, symmetric=False, reynolds=20.0)
    upright = np.asarray(rotate(jnp.asarray(smooth_contour(naca4("4418"), domain.nodes)), 10.0))
    mirrored = np.roll((upright * [1, -1])[::-1], 1, axis=0)
    a, b = (report(domain, m, 20.0) for m in (upright, mirrored))
    assert a.cl > 0.5
    assert a.cl == pytest.approx(-b.cl, rel=1e-9)
    assert a.cd == pytest.approx(b.cd, rel=1e-9)


def test_drag_does_not_jitter_as_the_body_moves_through_the_grid():
    domain = make_domain(Unbounded(), FIDELITIES["standard"], (1.5, 1.5), symmetric=True)
    h = domain.lattice.step[0]
    body = family_markers(CYLINDER, domain.nodes)
    drags = [
        float(solve(domain, body + h * jnp.array(shift), jnp.asarray(20.0)).coefficients.drag)
        for shift in ((0, 0), (0.25, 0), (0.5, 0), (0.75, 0), (1, 0))
    ]
    drift = np.polyval(np.polyfit(np.arange(5), drags, 1), np.arange(5))  # nearer the inlet
    jitter = np.abs(drags - drift).max() / drags[0]
    assert jitter < 5e-4, f"jitter {jitter:.1e}, drags {drags}"


def test_drag_does_not_jitter_as_a_flat_side_moves_through_the_rows():
    """Half a cell sideways; without the ripple of the retraction this is 4e-4."""
    fidelity = FIDELITIES["standard"]
    domain = make_domain(Unbounded(), fidelity, (1.75, 1.25), symmetric=False)
    body = family_markers(jnp.array([16 / 9, 0, 0, 0]), domain.nodes)  # 12 cells high
    there = body + jnp.array([0.0, 0.5 / fidelity.cells])
    here, moved = (
        float(solve(domain, markers, jnp.asarray(20.0)).coefficients.drag)
        for markers in (body, there)
    )
    assert moved == pytest.approx(here, rel=1e-4)


def test_status_says_when_newton_stops_early(cylinder_domain):
    case = steady.prepare(cylinder_domain, family_markers(CYLINDER, 96), jnp.asarray(40.0))
    settings_ = NewtonSettings(tolerance=1e-10, max_steps=1)
    _, info = steady.body_flow(cylinder_domain, case, settings=settings_)
    assert not bool(info.converged)
    assert int(info.steps) == 1


def test_a_flow_that_is_not_found_raises(cylinder_domain):
    plate = np.asarray(family_markers(jnp.array([0.5, 0, 0, 0]), cylinder_domain.nodes))
    with pytest.raises(NotConverged, match="did not converge"):
        report(cylinder_domain, plate, 250.0)


def test_a_body_beyond_the_box_of_a_domain_is_refused(cylinder_domain):
    plate = np.asarray(family_markers(jnp.array([0.3, 0, 0, 0]), cylinder_domain.nodes))
    with pytest.raises(InvalidInput, match="reaches beyond"):
        report(cylinder_domain, plate, 1.0)


def test_nothing_recompiles_for_another_body_of_the_same_shape(cylinder_domain):
    nodes = 96
    solve(cylinder_domain, family_markers(CYLINDER, nodes), jnp.asarray(10.0))
    before = solve._cache_size()
    solve(cylinder_domain, family_markers(LENS, nodes), jnp.asarray(17.0))
    assert solve._cache_size() == before


def test_gmres_stops_at_the_first_vector_that_suffices():
    matrix = jnp.diag(jnp.array([1.0, 1.0, 2.0, 2.0, 3.0, 3.0]))  # three eigenvalues: three vectors
    result = gmres(lambda x: matrix @ x, jnp.ones(6), 1e-12, 6)
    assert int(result.steps) == 3
    assert np.allclose(matrix @ result.x, 1.0)
    assert bool(gmres(lambda x: matrix @ x, jnp.zeros(6), 1e-12, 6).converged)
    assert not bool(gmres(lambda x: matrix @ x, jnp.full(6, jnp.nan), 1e-12, 6).converged)


def test_thin_and_large_bodies_are_refused():
    thin = np.asarray(family_markers(jnp.array([18.0, 0, 0, 0]), 400))
    with pytest.raises(InvalidInput, match="--cells"):
        body_domain(Unbounded(), FIDELITIES["draft"], thin, True, 1.0)
    large = 6 * np.asarray(family_markers(CYLINDER, 400))
    with pytest.raises(InvalidInput, match="too large"):
        body_domain(Unbounded(), FIDELITIES["draft"], large, True, 1.0)
    with pytest.raises(InvalidInput, match="tunnel"):
        body_domain(Tunnel(1.5), FIDELITIES["draft"], large / 6, True, 1.0)


SCENE = Scene(fidelity=Fidelity("", 8, 2.5, 4, 5, 5))
bounded = [st.floats(*bounds) for bounds in Family().bounds.tolist()]


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.tuples(*bounded), st.floats(0.5, 45.0))
def test_any_body_of_the_family_converges_to_a_sane_drag(parameters, reynolds):
    body = jnp.asarray(parameters)
    if float(opening(body)) < 0.05:
        return
    domain = scene_domain(SCENE)
    solution = solve(domain, family_markers(body, domain.nodes), jnp.asarray(reynolds))
    assert bool(solution.info.converged)
    cylinder = 2.0 + 10.0 / reynolds
    assert 0.3 * cylinder < float(solution.coefficients.drag) < 2.5 * cylinder


@pytest.mark.slow
@pytest.mark.parametrize("reynolds", UNBOUNDED)
def test_fine_grid_is_within_a_thousandth(reynolds):
    drag = float(cylinder_drag(Unbounded(), FIDELITIES["fine"], reynolds).drag)
    assert drag == pytest.approx(UNBOUNDED[reynolds], rel=0.001)


def test_any_tunnel_height_fits_the_grid():
    """Rows shrink a little where the height is no multiple of a cell: the drag stays smooth."""
    heights = (7.9, 8.0, 8.1)
    below, middle, above = (
        float(cylinder_drag(Tunnel(h), FIDELITIES["draft"], 10.0).drag) for h in heights
    )
    assert below > middle > above
    assert abs(below - 2 * middle + above) < 0.2 * (below - above)


def test_moment_turns_an_ellipse_across_the_stream():
    """At incidence the moment is nose up, and the mirror image has the opposite one."""
    fidelity = FIDELITIES["draft"]
    moments = []
    for incidence in (20.0, -20.0):
        markers = np.asarray(rotate(family_markers(jnp.array([2.0, 0, 0, 0]), 300), incidence))
        domain = body_domain(Unbounded(), fidelity, markers, symmetric=False, reynolds=20.0)
        body = rotate(family_markers(jnp.array([2.0, 0, 0, 0]), domain.nodes), incidence)
        moments.append(float(solve(domain, body, jnp.asarray(20.0)).coefficients.moment))
    assert moments[0] > 0.1
    assert moments[0] == pytest.approx(-moments[1], rel=1e-9)
