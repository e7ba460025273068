"""Camber and incidence as parameters: exact contours, bounds, flows, gradients, commands."""

import dataclasses
import json
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import SECTIONS, TINY
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from shapeopt import Problem
from shapeopt.commands.predict_drag import main as predict_drag
from shapeopt.commands.solve_drag import main as solve_drag
from shapeopt.render.page.page import page
from surrogate import (
    Family,
    Flow,
    InvalidInput,
    NotConverged,
    Scene,
    Surrogate,
    contour_shape,
    family_shape,
    train,
)
from surrogate.body.contour import crosses_itself
from surrogate.body.measures import AREA, moments
from surrogate.body.parameters import PARAMETERS, Kind
from surrogate.body.validity import are_valid
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.model.network import blank_network

SCENE = Scene(family=SECTIONS, fidelity=TINY)
FLOW = Flow(SCENE, NewtonSettings(tolerance=1e-10, linear_tolerance=1e-8))
BODY = jnp.array([2.0, 0.1, 0.2, 6.0])
MIRROR = jnp.array([1.0, 1.0, -1.0, -1.0])
WIDEST = Family(
    aspect=(0.5, 6),
    **{f"beta{k}": (-0.3 / (k - 1), 0.3 / (k - 1)) for k in range(2, 13)},
    **{f"gamma{k}": (-1.0 / k, 1.0 / k) for k in range(2, 7)},
    incidence=(-90, 90),
)
RECORD = {"method": "none", "drag_error_mean": 0.01, "drag_error_max": 0.04, "held_out": 7}
RANGES = st.tuples(st.floats(-30, 30), st.floats(1, 60))


def spectral(markers):
    """Area and centroid by a rule that is exact for contours of few harmonics."""
    waves = 1j * np.fft.fftfreq(len(markers), 1 / len(markers))
    x, y = np.asarray(markers).T
    dx, dy = (np.fft.ifft(waves * np.fft.fft(part)).real for part in (x, y))
    area = 2 * np.pi * np.mean(y * dx)
    return area, 2 * np.pi * np.array([-np.mean(x**2 * dy), np.mean(y**2 * dx)]) / 2 / area


def members(family):
    """Bodies anywhere in the ranges, their ends included."""
    return st.tuples(*(st.floats(*ends) for ends in family.bounds.tolist())).map(np.array)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(members(WIDEST))
def test_exact_area_centroid_and_thickness_with_camber(body):
    kind, without = WIDEST.body_class, body.copy()
    assume(float(kind.min_thickness_ratio(jnp.array(body))) > 0.02)
    without[[*kind.indices(Kind.CAMBER), *kind.indices(Kind.INCIDENCE)]] = 0
    outline, plain = (np.asarray(WIDEST.outline(jnp.array(b), 256)) for b in (body, without))
    area, centroid = spectral(outline)
    assert area == pytest.approx(AREA, rel=1e-12)
    assert np.abs(centroid).max() < 2e-3  # that of the polygon is the origin
    assert np.abs(moments(jnp.asarray(outline))[1]).max() < 1e-12
    assert np.allclose(outline[:, 0], plain[:, 0], atol=1e-12)  # and so the ends
    thick, thin = (np.diff(np.stack([b[:0:-1, 1], b[1:, 1]]), axis=0) for b in (outline, plain))
    assert np.allclose(thick, thin, atol=1e-12)
    for measure in (kind.length, kind.thickness, kind.thicknesses, kind.min_thickness_ratio):
        assert np.array_equal(measure(jnp.array(body)), measure(jnp.array(without)))
    assert not crosses_itself(outline)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(members(WIDEST))
def test_camber_is_the_distance_of_the_mean_line_from_the_chord(body):
    outline = np.asarray(WIDEST.outline(jnp.array(body), 720))
    (x, middle), chord = (outline[1:360] + outline[:360:-1]).T / 2, outline[[0, 360]]
    above = middle - np.interp(x, *chord.T)
    camber = float(WIDEST.body_class.camber(jnp.array(body)))
    assert camber == pytest.approx(np.abs(above).max(), abs=2e-3)


def test_exact_camber_of_one_mode_and_its_bound_needs_camber():
    half_height = float(SECTIONS.body_class.half_axes(BODY)[1])
    assert float(SECTIONS.body_class.camber(BODY)) == pytest.approx(
        2 * half_height * 0.2, rel=1e-12
    )
    with pytest.raises(InvalidInput, match="max camber: the bodies of this scene have no camber"):
        Problem(Scene(), 10.0, max_camber=0.1)


def test_exact_contour_of_its_definition():
    t = 2 * np.pi * np.arange(500) / 500
    y = np.sin(t) + 0.1 * np.sin(2 * t) - 0.3 * np.cos(2 * t) - 0.1 * np.cos(3 * t)
    points = np.stack([-np.cos(t), y / 2], axis=1)  # c / 2 = 1, b = 1 / 2 at aspect 2, times sqrt 2
    points = (points - np.asarray(moments(jnp.asarray(points))[1])) / math.sqrt(2)
    named = {"aspect": 2, "beta2": 0.1, "gamma2": 0.3, "gamma3": 0.1}
    assert np.allclose(family_shape(named).draw(500), points, atol=1e-12)
    turn = np.deg2rad(20)
    nose_up = points @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    turned = family_shape(named | {"incidence": 20})
    assert np.allclose(turned.draw(500), nose_up, atol=1e-12)
    assert np.allclose(turned.markers(500), nose_up, atol=1e-12)
    assert np.allclose(turned.body_class.outline(turned.values, 500), points, atol=1e-12)
    assert turned.chord == pytest.approx(math.sqrt(2))
    middle = points[np.abs(points[:, 0]) < 0.1].mean(axis=0)
    assert middle[1] > points[[0, 250], 1].mean() + 0.1  # gamma2 > 0: highest in the middle


def test_exact_mirror_images():
    up, down = (np.asarray(SECTIONS.markers(body, 200)) for body in (BODY, BODY * MIRROR))
    assert np.allclose(up[1:][::-1] * [1, -1], down[1:], atol=1e-14)


def test_radii_are_the_least_of_both_sides():
    """Against the circles through three neighbouring points of a dense contour."""
    body = jnp.array([2.0, 0.1, 0.3, 5.0])
    r = np.asarray(SECTIONS.outline(body, 7200))
    a, b = np.roll(r, 1, axis=0) - r, np.roll(r, -1, axis=0) - r
    sine = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / np.prod(
        np.linalg.norm([a, b], axis=2), axis=0
    )
    circles = np.linalg.norm(a - b, axis=1) / (2 * sine)
    nose, tail, side = (float(radius) for radius in SECTIONS.body_class.radii(body))
    assert [nose, tail] == pytest.approx([circles[0], circles[3600]], rel=1e-3)
    away = np.r_[20:3581, 3620:7181]  # one degree from the ends
    assert side == pytest.approx(circles[away].min(), rel=1e-3)
    upper, lower = circles[20:3581].min(), circles[3620:7181].min()
    assert abs(upper / lower - 1) > 0.05  # or the test would prove little


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.data(), RANGES, st.sampled_from([(0.5, 6.0), (2.0, 2.5)]))
@pytest.mark.slow
def test_extent_holds_every_member(data, turns, aspect):
    """Corners of the ranges as well as their inside, at any range of incidence."""
    low, width = turns
    ranges = dict(WIDEST.ranges) | {"aspect": aspect, "incidence": (low, low + width)}
    family = Family(**ranges)
    inside = members(family)
    corners = st.tuples(*map(st.sampled_from, family.bounds.tolist())).map(np.array)
    draws = data.draw(st.lists(inside | corners, min_size=4, max_size=4))
    for body in draws:
        points = np.asarray(_contour(family, jnp.array(body)))
        assert np.all(2 * np.abs(points).max(axis=0) <= family.extent)


def _contour(family, body):
    return jax.jit(family.body_class.markers, static_argnums=1)(body, 400)


def test_extent_is_not_much_more_than_its_largest_members():
    ends = np.array([[a, b, g, i] for a in (1.5, 4) for b in (-0.2, 0.2) for g in (-0.3, 0.3)
                     for i in np.linspace(-4, 12, 9)])  # fmt: skip
    points = jax.vmap(lambda body: SECTIONS.markers(body, 200))(jnp.array(ends))
    assert np.all(np.array(SECTIONS.extent) < 1.1 * 2 * np.abs(points).max(axis=(0, 1)))


def test_incidence_among_the_parameters_or_apart_is_the_same():
    among, apart = family_shape({"aspect": 2, "incidence": 5}), family_shape({"aspect": 2}, 5)
    assert among.parameters == apart.parameters == {"aspect": 2.0, "incidence": 5.0}
    assert among.incidence == apart.incidence == 5
    assert among.body_class == apart.body_class
    assert np.array_equal(among.draw(64), apart.draw(64))
    with pytest.raises(InvalidInput, match="incidence: is given among the parameters and apart"):
        family_shape({"aspect": 2, "incidence": 5}, 5)


@pytest.mark.parametrize(
    ("named", "symmetric"),
    [
        ({"beta2": 0.1}, True),
        ({"gamma2": 0.0, "incidence": 0.0}, True),
        ({"gamma3": 0.1}, False),
        ({"incidence": -1.0}, False),
    ],
)
def test_bodies_are_symmetric_without_camber_and_incidence(named, symmetric):
    shape = family_shape({"aspect": 2.0} | named)
    assert shape.symmetric == symmetric
    assert shape.body_class.symmetric == all(name.startswith("beta") for name in named)


@pytest.mark.parametrize("name", [n for n, p in PARAMETERS.items() if p.kind is Kind.CAMBER])
def test_bodies_in_space_have_no_camber(name):
    words = f"{name}: 3-D bodies have no camber; incidence turns them nose up"
    with pytest.raises(InvalidInput, match=words):
        family_shape({"aspect": 2.0, name: 0.1}, dimension=3)
    with pytest.raises(InvalidInput, match=words):
        Family(3, **{"aspect": (1, 2), name: (0, 0.1)})


@pytest.mark.parametrize(
    ("named", "words"),
    [
        ({"incidence": 181}, "incidence 181: must lie between -180 and 180"),
        ({"gamma2": 3}, "gamma2 3: must lie between -2 and 2"),
        ({"gamma7": 0.1}, "no parameter 'gamma7'"),
    ],
)
def test_bodies_beyond_the_limits_are_refused(named, words):
    with pytest.raises(InvalidInput, match=words):
        family_shape({"aspect": 2.0} | named)


def test_a_range_of_incidence_keeps_the_nose_ahead():
    with pytest.raises(InvalidInput, match="from -90 to 90"):
        Family(aspect=(1, 2), incidence=(-100, 10))


def test_a_scene_in_a_file(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("[family]\naspect = [1.5, 6]\nincidence = [-4, 12]\ngamma2 = [-0.3, 0.3]\n")
    scene = Scene.read(path)
    assert scene == Scene(family=Family(aspect=(1.5, 6), gamma2=(-0.3, 0.3), incidence=(-4, 12)))
    scene.write(path)
    assert Scene.read(path) == Scene.of(json.loads(json.dumps(scene.record))) == scene
    assert scene.family.names == ("aspect", "gamma2", "incidence")
    words = scene.explain()
    assert "family with camber and incidence" in words
    assert "incidence -4 to 12" in words
    assert "Made for drags within 0.4 % over Re 1 to 200, aspect 1.5 to 6" in words
    assert f"({math.prod(Flow(scene).domain.lattice.shape)} cells)" in words


def test_samples_are_inside_and_valid():
    samples = WIDEST.sample(jax.random.key(1), 100)
    assert all(WIDEST.contains(np.asarray(sample)) for sample in samples)
    assert are_valid(WIDEST.body_class, np.asarray(samples)).all()
    assert WIDEST.check(samples[0]).shape == (18,)


@pytest.mark.slow
def test_flows_of_mirror_images_have_the_same_drag_and_opposite_lift_and_moment():
    assert not FLOW.domain.lattice.folded
    up, down = (FLOW.solve(body, 10.0, estimate=False) for body in (BODY, BODY * MIRROR))
    assert up.drag == pytest.approx(down.drag, rel=1e-7)
    assert up.lift == pytest.approx(-down.lift, rel=1e-6)
    assert up.moment == pytest.approx(-down.moment, rel=1e-6)
    assert up.lift > 0.02 * up.drag  # nose up
    drags = jax.vmap(FLOW.drag, (0, None))(jnp.stack([BODY, BODY * MIRROR]), 10.0)
    assert np.allclose(drags, up.drag, rtol=1e-6)
    assert FLOW.solve_all(np.array([BODY]), np.array([10.0]), 1).drag[0] == pytest.approx(up.drag)


def test_taylor_remainders_of_every_load_in_camber_and_incidence():
    """Halve the step four times; the remainder of the tangent line must fall at second order."""
    direction, steps = jnp.array([0.0, 0.0, 0.3, 8.0]), 0.1 / 2.0 ** np.arange(5)
    values, jacobian = FLOW.loads(BODY, 10.0), jax.jacobian(FLOW.loads)(BODY, 10.0)
    slopes = np.asarray(jacobian @ direction)
    assert np.all(np.abs(slopes) > 1e-3)  # or the test would prove little
    loads = np.array([FLOW.loads(BODY + h * direction, 10.0) for h in steps])
    remainders = np.abs(loads - values - steps[:, None] * slopes)
    rates = np.log2(remainders[:-1] / remainders[1:])
    assert np.all(rates[-1] > 1.9), f"remainders {remainders}, rates {rates}"


@pytest.mark.slow
@pytest.mark.parametrize("stream", ["unbounded", "tunnel:8"])
def test_taylor_remainders_in_all_parameters_and_re(stream):
    """Every camber mode among them, unbounded and in a tunnel; of every load."""
    modes = {f"gamma{k}": (-0.3, 0.3) for k in range(2, 7)}
    family = Family(aspect=(1.5, 4), beta2=(-0.2, 0.2), **modes, incidence=(-4, 12))
    exact = NewtonSettings(tolerance=1e-10, linear_tolerance=1e-8)
    flow = Flow(Scene(stream, family=family, fidelity=TINY), exact)
    body = jnp.array([2.0, 0.1, 0.2, -0.05, 0.03, 0.02, -0.02, 6.0])
    direction = jnp.array([-0.4, 0.1, 0.3, 0.2, -0.15, 0.1, -0.1, 12.0])
    by_body, by_re = jax.jacobian(flow.loads, (0, 1))(body, jnp.asarray(10.0))
    assert np.all(np.abs(by_body[:, 2:7]) > 1e-4)  # or the test would prove little
    slopes, steps = np.asarray(by_body @ direction + 3.0 * by_re), np.array([0.1, 0.05, 0.025])
    moved = np.array([flow.loads(body + h * direction, 10.0 + 3.0 * h) for h in steps])
    remainders = np.abs(moved - flow.loads(body, 10.0) - steps[:, None] * slopes)
    rates = np.log2(remainders[:-1] / remainders[1:])
    assert np.all(rates[-1] > 1.9), f"remainders {remainders}, rates {rates}"


def test_quick_gradients_err_by_little_of_the_drag_over_the_range_of_a_parameter():
    exact = jax.jacobian(FLOW.loads, (0, 1))(BODY, jnp.asarray(10.0))
    quick, widths = FLOW.loads_and_gradients(BODY, 10.0), np.ptp(SECTIONS.bounds, axis=1)
    atol = 1e-3 * float(quick.drag)
    np.testing.assert_allclose(quick.gradients * widths, exact[0] * widths, atol=atol, rtol=0)
    np.testing.assert_allclose(10 * quick.by_reynolds, 10 * exact[1], atol=atol, rtol=0)


@pytest.mark.slow
def test_every_gradient_of_the_drag_has_camber_and_incidence():
    gradient = jax.grad(FLOW.drag)(BODY, 10.0)
    quick = FLOW.loads_and_gradients(BODY, 10.0)
    assert np.allclose(quick.gradient, gradient, atol=2e-3 * float(jnp.abs(gradient).max()))
    solved = FLOW.solve(BODY, 10.0, gradient=True, estimate=False).gradient
    assert list(solved) == [*SECTIONS.names, "reynolds"]
    assert np.allclose([solved[name] for name in SECTIONS.names], gradient, rtol=1e-5, atol=1e-7)


@pytest.mark.slow
def test_a_level_body_is_solved_whole_where_the_gradient_in_its_incidence_is_wanted():
    body = family_shape({"aspect": 2.0, "incidence": 0.0})
    assert FLOW.solve(body, 10.0, estimate=False).domain.lattice.folded
    found = FLOW.solve(body, 10.0, estimate=False, gradient=True)
    assert not found.domain.lattice.folded
    assert found.gradient["incidence"] == pytest.approx(0, abs=1e-6)
    with pytest.raises(InvalidInput, match="gradient: is for bodies of the family"):
        FLOW.solve("0012", 10.0, gradient=True)


@pytest.mark.parametrize("named", [{"incidence": 10.0}, {"gamma2": 0.2}], ids=["turned", "arched"])
def test_golden_flow_by_parameters_and_by_the_contour(named):
    """The same body on the same grid, apart from the contour's smoothing."""
    t, flow = np.linspace(0, 2 * np.pi, 400, endpoint=False), Flow(Scene())
    y = (np.sin(t) - named.get("gamma2", 0.0) * np.cos(2 * t)) / 2
    contour = contour_shape(np.stack([-np.cos(t), y], axis=1), named.get("incidence", 0.0))
    shapes = family_shape({"aspect": 2.0} | named), contour
    by_name, drawn = (flow.solve(shape, 20.0, estimate=False) for shape in shapes)
    if named == {"incidence": 10.0}:
        assert by_name.drag == pytest.approx(1.7517, rel=0.0025)  # finite elements
        assert by_name.lift == pytest.approx(0.3057, abs=0.0025 * by_name.drag)
    assert drawn.drag == pytest.approx(by_name.drag, rel=1e-3)
    assert drawn.lift == pytest.approx(by_name.lift, rel=0.02)
    assert drawn.moment == pytest.approx(by_name.moment, rel=0.02)


def test_traced_bodies_beyond_the_limits_are_nan():
    body = BODY.at[3].set(200.0)
    with pytest.raises(InvalidInput, match="incidence 200"):
        FLOW.drag(body, 10.0)
    assert np.isnan(float(jax.jit(FLOW.drag)(body, 10.0)))


@pytest.mark.slow
def test_solve_drag_with_camber_and_its_gradient(capsys):
    arguments = ["--aspect", "2", "--gamma2", "0.2", "--gamma3", "-0.1", "--incidence", "0,4"]
    solve_drag([*arguments, "--reynolds", "10", "--fidelity", "draft", "--gradient", "--json"])
    rows = json.loads(capsys.readouterr().out.splitlines()[-1])["results"]
    level, turned = rows
    assert abs(level["cl"]) > 0.01
    assert turned["cl"] > level["cl"] + 0.01  # nose up
    inputs = {"aspect", "beta2", "beta3", "beta4", "gamma2", "gamma3", "incidence", "reynolds"}
    for row in rows:
        assert set(row["gradient"]) == {"cd", "cl", "cm"}
        assert all(set(slopes) == inputs for slopes in row["gradient"].values())
        slope = row["gradient"]["cl"]["incidence"]
        assert slope == pytest.approx((turned["cl"] - level["cl"]) / 4, rel=0.1)


def test_predict_drag_knows_the_familys_parameters_only():
    arguments = ["--aspect", "2", "--reynolds", "10"]
    with pytest.raises(InvalidInput, match="gamma2 is none of the family's"):
        predict_drag([*arguments, "--gamma2", "0.1"])
    plain, level = (predict_drag([*arguments, *more]) for more in ([], ["--incidence", "0"]))
    assert plain["results"][0]["cd"] == level["results"][0]["cd"]


def test_a_page_of_lifting_bodies_has_their_sliders():
    net = Surrogate(blank_network(SCENE, (4,), jax.random.key(0)), SCENE, RECORD)
    text = page(net)
    for name in SECTIONS.names:
        assert f'type="range" id="{name}"' in text
    assert json.dumps([1.0, 1.0, -1.0, -1.0, 1.0]) in text  # the mirror image, of parameters and Re


@pytest.mark.slow
@pytest.mark.parametrize("method", ["supervised", "hig"])
def test_a_training_with_camber_and_incidence(method):
    scene = dataclasses.replace(SCENE, reynolds=(5, 20))
    net = train(scene, method, samples=12, preset="quick", progress=False)
    assert net.recorded("drag_error_mean") < 0.02
    assert float(net.drag(BODY, 10.0)) == pytest.approx(float(FLOW.drag(BODY, 10.0)), rel=0.03)


def test_a_level_body_of_a_lifting_scene_has_the_slopes_of_its_lift():
    """On the scene's own grid, which has no mirror plane, as on one of the body's own."""
    level = jnp.array([2.0, 0.1, 0.0, 0.0])
    found = FLOW.solve(level, 10.0, gradient=True, estimate=False)
    assert found.lift == pytest.approx(0.0, abs=1e-8)
    assert set(found.gradients) == {"cd", "cl", "cm"}
    step = 0.1
    up = FLOW.loads(level.at[3].set(step), 10.0)
    assert found.gradients["cl"]["incidence"] == pytest.approx(float(up[1]) / step, rel=1e-3)
    assert not found.domain.modes.symmetric


def test_unconverged_loads_are_returned_only_where_asked_for():
    hasty = Flow(SCENE, NewtonSettings(max_steps=1))
    with pytest.raises(NotConverged, match="Re 20 did not converge"):
        hasty.loads_and_gradients(BODY, 20.0)
    found = hasty.loads_and_gradients(BODY, 20.0, partial=True)
    assert not found.converged
    assert np.isnan(found.loads).all()
    assert found.green_applications > 0


def test_the_incidence_of_a_contour_is_kept(tmp_path):
    """And the contour is a copy of the caller's points."""
    points = np.array(family_shape({"aspect": 3.0}).draw(200))
    shape = contour_shape(points, 10.0)
    assert shape.incidence == 10.0
    before = shape.draw(50)
    points *= 3
    np.testing.assert_array_equal(shape.draw(50), before)
    found = Flow(Scene(fidelity="draft")).solve(shape, 10.0, estimate=False)
    record = json.loads((found.write(tmp_path / "flow") / "flow.json").read_text())
    assert record["incidence"] == 10.0
    assert record["onset"] == pytest.approx(found.onset)
