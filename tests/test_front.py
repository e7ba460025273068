"""The public API: its names, the common interface of both drag models, what they refuse."""

import dataclasses
import functools
import importlib.metadata
import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TINY
from scipy.optimize import minimize

import surrogate
from shapeopt import Problem, optimise
from surrogate import Flow, InvalidInput, Scene, load

NAMES = """
    FIDELITIES Family Fidelity Flow FlowBatch Forces InvalidInput LoadsAndGradients NewtonSettings
    NotConverged Particle Scene Settled Shape Solution Surrogate Tunnel
    Unbounded __version__ contour_shape export family_shape load naca4 read_contour
    save settle train
"""
FLOW = Flow(Scene(fidelity=TINY))
NET = load("pretrained")
MODELS = {"flow": FLOW, "surrogate": NET}
both = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
ROUND = np.array([1.0, 0.0, 0.0, 0.0])
BODY = np.array([2.0, 0.125, -0.0625, 0.03125])  # exact in any kind of floating-point number


def test_public_names():
    assert sorted(dir(surrogate)) == sorted(NAMES.split())
    assert all(hasattr(surrogate, name) for name in dir(surrogate))
    assert surrogate.__version__ == importlib.metadata.version("drag-surrogates")


def test_both_models_are_asked_alike():
    flow, net = (list(inspect.signature(model.drag).parameters) for model in MODELS.values())
    assert flow[:2] == net[:2] == ["parameters", "reynolds"]
    for model in MODELS.values():
        more = list(inspect.signature(model.drag).parameters.values())[2:]
        assert all(argument.default is False for argument in more)
    assert float(FLOW.drag(BODY, 20.0)) == pytest.approx(float(NET.drag(BODY, 20.0)), rel=0.03)


def test_a_solution_tells_loads_fields_and_work():
    found = FLOW.solve(BODY, 20.0, gradient=True, estimate=False)
    assert found.drag == pytest.approx(float(FLOW.drag(BODY, 20.0)), rel=1e-6)
    assert found.drag == pytest.approx(found.drag_pressure + found.drag_friction)
    assert found.lift == 0
    assert found.moment == pytest.approx(0, abs=1e-9)
    assert (found.status, found.estimated_error) == ("unknown", None)
    assert found.green_applications > 10
    assert found.seconds > 0
    shape, slope = jax.grad(FLOW.drag, argnums=(0, 1))(jnp.asarray(BODY), 20.0)
    assert list(found.gradient) == [*FLOW.scene.family.names, "reynolds"]
    assert np.allclose(list(found.gradient.values()), [*shape, slope], rtol=1e-4)
    assert found.markers.shape == (FLOW.domain.nodes, 2)
    assert found.velocity.shape == (2, *FLOW.domain.lattice.unfolded.shape)
    assert found.surface(50).cp.shape == (50,)


ANSWERED = [(BODY, 20.0), (BODY + np.array([0.02, 0, 0, 0]), 10.0)]
UNANSWERED = [(BODY, re) for re in (0.0, -1.0, np.nan, 0.01, 60.0)]
UNANSWERED += [(body, 20.0) for body in ([2.0, 0.9, 0, 0], [9.0, 0, 0, 0], [np.nan, 0, 0, 0])]


@pytest.fixture(scope="module", params=MODELS.values(), ids=MODELS)
def batch(request):
    """Drags and slopes of a batch by jit, vmap and grad at once, and the model."""
    pairs = zip(*ANSWERED, *UNANSWERED, strict=True)
    bodies, reynolds = (jnp.asarray(part, float) for part in pairs)
    slopes = jax.value_and_grad(request.param.drag, argnums=(0, 1))
    return request.param, *jax.jit(jax.vmap(slopes))(bodies, reynolds)


def test_drag_under_jit_vmap_and_grad(batch):
    model, drags, (shapes, slopes) = batch
    for k, (body, reynolds) in enumerate(ANSWERED):
        assert float(drags[k]) == pytest.approx(float(model.drag(body, reynolds)), rel=1e-6)
        step = np.array([0.02, 0.0, 0.0, 0.0])
        ends = (float(model.drag(body + s * step, reynolds + 0.2 * s)) for s in (1, -1))
        change = float(2 * step @ shapes[k] + 0.4 * slopes[k])
        assert change == pytest.approx(next(ends) - next(ends), rel=5e-3)
    body, reynolds = ANSWERED[0]
    assert float(jax.jit(model.drag)(body, reynolds)) == pytest.approx(float(drags[0]), rel=1e-6)


def test_traced_what_cannot_be_answered_is_nan(batch):
    """So are its gradients: an optimiser would take nought for a minimum."""
    _, drags, (shapes, slopes) = batch
    known = len(ANSWERED)
    for values in (drags, slopes, *shapes.T):
        assert np.isfinite(values[:known]).all(), values
    for values in (drags, slopes, shapes[:, 0]):
        assert np.isnan(values[known:]).all(), values


@both
def test_constants_inside_a_transformation_are_answered(model):
    """A function that jit compiles may ask for a body that does not depend on its arguments."""
    expected = float(model.drag(BODY, 20.0))
    scaled = jax.jit(lambda factor: factor * model.drag(BODY.tolist(), 20.0))
    assert float(scaled(2.0)) == pytest.approx(2 * expected, rel=1e-6)
    thin = jax.jit(lambda factor: factor * model.drag([9.0, 0, 0, 0], 20.0))
    assert np.isnan(float(thin(2.0)))


def test_nothing_recompiles_in_a_jitted_surrogate(compilations):
    drag = jax.jit(lambda *at: NET.drag(*at))
    drag(jnp.asarray(BODY), jnp.asarray(20.0))
    assert compilations
    other = jnp.asarray(BODY + 0.01), jnp.asarray(3.0)
    compilations.clear()
    drag(*other)
    assert compilations == []


NUMBERS = {
    "int": 20,
    "float": 20.0,
    "float32": np.float32(20),
    "float16": np.float16(20),
    "int64": np.int64(20),
    "uint8": np.uint8(20),
    "0-d": np.array(20.0),
    "0-d int": np.array(20),
    "jax": jnp.asarray(20.0),
    "jax int": jnp.asarray(20),
}
BODIES = {
    "list": BODY.tolist(),
    "tuple": tuple(BODY.tolist()),
    "numpy scalars": list(BODY),
    "float32": BODY.astype(np.float32),
    "jax": jnp.asarray(BODY),
    "jax float32": jnp.asarray(BODY, jnp.float32),
}


@both
def test_numbers_of_every_kind_are_numbers(model, unchecked):
    expected = float(model.drag(BODY, 20.0))
    for kind, reynolds in NUMBERS.items():
        assert float(model.drag(BODY, reynolds)) == expected, kind
    for kind, body in BODIES.items():
        assert float(model.drag(body, 20.0)) == expected, kind


REYNOLDS_THAT_ARE_NONE = {
    "0": (0, "must be a finite number above 0"),
    "-5": (-5.0, "must be a finite number above 0"),
    "nan": (np.nan, "must be a finite number"),
    "inf": (np.inf, "must be a finite number"),
    "text": ("40", "must be one number"),
    "none": (None, "must be one number"),
    "complex": (20 + 0j, "must be one number"),
    "tiny": (1e-6, "tested from 0.001"),
    "huge": (1e4, "tested up to 350"),
    "astronomic": (10**400, "must be one number"),
}
BODIES_THAT_ARE_NONE = {
    "three": (BODY[:3], "4 parameters are needed: aspect, beta2, beta3, beta4"),
    "five": (np.append(BODY, 0.0), "4 parameters are needed"),
    "number": (2.0, "4 parameters are needed"),
    "text": ("cylinder", "must be numbers|four digits|NACA|flow.solve"),
    "texts": (["2", "0", "0", "0"], "must be numbers"),
    "none": (None, "must be numbers"),
    "truth": ([True, False, False, False], "must be numbers"),
    "complex body": ([2j, 0, 0, 0], "must be numbers"),
    "names": ({"beta2": 0.1}, "has no aspect"),
    "nan": ([np.nan, 0, 0, 0], "finite number"),
    "flat": ([0.0, 0, 0, 0], "between 0.1 and 20"),
    "crossing": ([2.0, 0.9, 0, 0], "cross"),
    "ragged": ([[2.0], 0.1, 0, 0], "must be numbers"),
}


@both
@pytest.mark.parametrize("bad", REYNOLDS_THAT_ARE_NONE)
def test_reynolds_numbers_that_are_none_are_refused(model, bad, unchecked):
    value, words = REYNOLDS_THAT_ARE_NONE[bad]
    with pytest.raises(InvalidInput, match=words):
        model.drag(BODY, value)


@both
@pytest.mark.parametrize("bad", BODIES_THAT_ARE_NONE)
def test_bodies_that_are_none_are_refused(model, bad, unchecked):
    value, words = BODIES_THAT_ARE_NONE[bad]
    with pytest.raises(InvalidInput, match=words):
        model.drag(value, 20.0)


@pytest.mark.parametrize("bad", [*REYNOLDS_THAT_ARE_NONE, *BODIES_THAT_ARE_NONE])
def test_solve_refuses_what_drag_refuses(bad, unchecked):
    body, reynolds = BODY, 20.0
    if bad in BODIES_THAT_ARE_NONE:
        body, words = BODIES_THAT_ARE_NONE[bad]
    else:
        reynolds, words = REYNOLDS_THAT_ARE_NONE[bad]
    with pytest.raises(InvalidInput, match=words):
        FLOW.solve(body, reynolds)


BATCHES = {"bodies": (np.stack([BODY, BODY]), 20.0), "numbers": (BODY, [10.0, 20.0])}


@pytest.mark.parametrize("many", BATCHES)
def test_a_flow_takes_one_body_and_names_what_takes_many(many, unchecked):
    words = {"bodies": r"batch of 2.* flow\.solve_all.* jax\.vmap", "numbers": "must be one number"}
    for ask in (FLOW.drag, FLOW.solve):
        with pytest.raises(InvalidInput, match=words[many]):
            ask(*BATCHES[many])


@pytest.mark.parametrize("transform", [lambda f: f, jax.jit], ids=["eager", "jit"])
def test_a_surrogate_takes_batches_that_broadcast(transform, generator):
    bodies = np.array([[2.0, 0.1, 0, 0], [3.0, 0, 0.1, 0], [1.5, 0, 0, -0.1]])
    numbers, drag = np.array([1.0, 10.0, 40.0]), transform(NET.drag)
    alone = np.array([[float(NET.drag(body, re)) for re in numbers] for body in bodies])
    for found, expected in (
        (drag(bodies, numbers), np.diag(alone)),
        (drag(bodies, 10.0), alone[:, 1]),
        (drag(bodies[0], numbers), alone[0]),
        (drag(bodies[:, None], numbers), alone),
        (drag(bodies[:0], numbers[:0]), np.zeros(0)),
    ):
        assert found.shape == expected.shape
        assert np.allclose(found, expected, rtol=1e-12)


def test_derivatives_of_a_batch_are_those_of_its_bodies():
    bodies, numbers = jnp.array([[2.0, 0.1, 0, 0], [3.0, 0, 0.1, 0]]), jnp.array([5.0, 30.0])
    slopes = jax.vmap(jax.grad(NET.drag, argnums=(0, 1)))(bodies, numbers)
    total = jax.grad(lambda *at: NET.drag(*at).sum(), argnums=(0, 1))(bodies, numbers)
    along = jax.jvp(NET.drag, (bodies, numbers), (jnp.ones((2, 4)), jnp.ones(2)))[1]
    assert np.allclose(slopes[0], total[0], rtol=1e-12)
    assert np.allclose(slopes[1], total[1], rtol=1e-12)
    assert np.allclose(along, slopes[0].sum(axis=1) + slopes[1], rtol=1e-12)


MANY_THAT_ARE_NONE = {
    "of three": (([BODY[:3].tolist()] * 2, 20.0), "4 parameters are needed"),
    "of other counts": ((np.stack([BODY] * 3), [1.0, 2.0]), r"\(3, 4\) and \(2,\).* broadcast"),
    "crossing": (([[2.0, 0, 0, 0], [2.0, 0.9, 0, 0]], 20.0), "cross"),
    "nan": ((BODY, [1.0, np.nan]), "must be a finite number"),
    "negative": ((BODY, [1.0, -1.0]), "above 0"),
    "outside": (
        ([[2.0, 0, 0, 0], [7.0, 0, 0, 0]], [45.0, 46.0]),
        r"aspect 7 at index 1 \(trained from 1 to 5\), Reynolds number 46 at index 1 \(trained "
        r"from 1 to 40\); extrapolate=True \(predict_drag.py --extrapolate\)",
    ),
}


@pytest.mark.parametrize("bad", MANY_THAT_ARE_NONE)
def test_batches_with_one_that_is_none_are_refused(bad, unchecked):
    arguments, words = MANY_THAT_ARE_NONE[bad]
    with pytest.raises(InvalidInput, match=words):
        NET.drag(*arguments)


def test_a_surrogate_beyond_its_trained_ranges():
    """Refused with the range, NaN when traced, answered where extrapolation is asked for."""
    outside = {
        r"aspect 7 \(trained from 1 to 5\)": ([7.0, 0, 0, 0], 20.0),
        r"beta2 -0\.35 \(trained from -0\.3 to 0\.3\)": ([2.0, -0.35, 0, 0], 20.0),
        r"Reynolds number 46 \(trained from 1 to 40\)": (BODY, 46.0),
    }
    jitted, bold = jax.jit(NET.drag), jax.jit(functools.partial(NET.drag, extrapolate=True))
    for words, (body, reynolds) in outside.items():
        with pytest.raises(InvalidInput, match=f"outside the trained ranges: {words}; extrapolate"):
            NET.drag(body, reynolds)
        drag = float(NET.drag(body, reynolds, extrapolate=True))
        assert drag > 0
        body = jnp.asarray(body, float)
        assert np.isnan(float(jitted(body, reynolds)))
        assert np.isnan(jax.grad(NET.drag)(body, reynolds)).all()
        assert float(bold(body, reynolds)) == pytest.approx(drag)


@pytest.mark.parametrize(
    ("body", "reynolds"),
    [([2.0, 0.9, 0, 0], 20.0), ([50.0, 0, 0, 0], 20.0), (BODY, 1e4), (BODY, 1e-4)],
    ids=["crossing", "slender", "huge", "tiny"],
)
def test_what_no_flow_has_is_not_extrapolated_to(body, reynolds):
    with pytest.raises(InvalidInput):
        NET.drag(body, reynolds, extrapolate=True)
    bold = jax.jit(functools.partial(NET.drag, extrapolate=True))
    assert np.isnan(bold(jnp.asarray(body, float), reynolds))


@pytest.mark.parametrize(("rounding", "answered"), [(1e-7, True), (1e-5, False)])
def test_rounding_at_the_ends_of_the_ranges_is_no_extrapolation(rounding, answered):
    high = NET.scene.family.bounds[:, 1] * [1, 1, 0, 0] * (1 + rounding)
    for body, reynolds in ((high, 20.0), (BODY, 40.0 * (1 + rounding)), (BODY, 1 - rounding)):
        assert np.isfinite(jax.jit(NET.drag)(body, reynolds)) == answered
        assert (not NET.outside(body, reynolds)) == answered
        if answered:
            assert NET.drag(body, reynolds) > 0
        else:
            with pytest.raises(InvalidInput, match="outside"):
                NET.drag(body, reynolds)


def test_bodies_in_single_precision_at_the_ends_of_the_ranges_are_answered():
    for end in NET.scene.family.bounds.T:
        body = np.float32([2.0, 0.0, end[2], 0.0])
        drag, same = float(NET.drag(body, 20.0)), float(NET.drag(body.astype(float), 20.0))
        assert drag == pytest.approx(same, rel=1e-6)
        assert np.isfinite(jax.jit(NET.drag)(body, 20.0))


def test_scipy_minimises_the_drag_within_the_bounds_of_the_family():
    """As in the README; the same optimum as by ``optimise``."""
    drag = jax.jit(jax.value_and_grad(lambda body: NET.drag(body, 40.0)))
    found = minimize(drag, [1.5, 0, 0, 0], jac=True, bounds=NET.scene.family.bounds)
    expected = optimise(Problem(NET.scene, 40.0), NET)
    assert found.success
    assert found.fun == pytest.approx(expected.drag, rel=1e-6)
    assert np.allclose(found.x, expected.parameters, atol=2e-3)


def test_the_steady_flow_beyond_the_onset_of_shedding_must_be_asked_for():
    same_grid = dataclasses.replace(FLOW.scene.fidelity, refinement=1.0)
    flow = Flow(dataclasses.replace(FLOW.scene, reynolds=(1, 60), fidelity=same_grid))
    for ask in (flow.drag, flow.solve):
        with pytest.raises(InvalidInput, match=r"allow_unsteady .* asks for it all the same"):
            ask(ROUND, 50.0)
    drag = float(flow.drag(ROUND, 50.0, allow_unsteady=True))
    assert drag < float(flow.drag(ROUND, 46.0))
    assert flow.solve(ROUND, 50.0, allow_unsteady=True, estimate=False).drag == pytest.approx(drag)


@pytest.mark.slow
def test_slender_bodies_are_answered_as_far_as_they_are_steady_and_traced_ones_too():
    flow = Flow(dataclasses.replace(FLOW.scene, reynolds=(1, 60)))
    drags = jax.jit(jax.vmap(flow.drag))(jnp.array([BODY, ROUND]), jnp.full(2, 50.0))
    assert np.isnan(drags).tolist() == [False, True]
    assert float(flow.drag(BODY, 50.0)) == pytest.approx(float(drags[0]))


def test_a_flow_above_its_scenes_range_is_refused():
    with pytest.raises(InvalidInput, match="made for wakes up to Re 40"):
        FLOW.drag(BODY, 45.0)


def test_what_is_no_scene_is_no_flow(unchecked):
    with pytest.raises(InvalidInput, match="is no Scene"):
        Flow("scene.toml")


def test_a_table_of_arrays_is_many_bodies():
    net, aspects = NET, np.array([1.2, 2.0, 2.8])
    rows = np.column_stack([aspects, np.full(3, 0.1), np.zeros(3), np.zeros(3)])
    table, expected = {"aspect": aspects, "beta2": 0.1}, net.drag(rows, 20.0)
    np.testing.assert_array_equal(net.drag(table, 20.0), expected)
    np.testing.assert_array_equal(net.drag(table | {"incidence": np.zeros(3)}, 20.0), expected)
    assert net.drag({"aspect": 2.0, "incidence": np.zeros(3)}, 20.0).shape == (3,)
    np.testing.assert_array_equal(net.error_bounds(table, 20.0), net.error_bounds(rows, 20.0))

    def drag(aspect):
        return net.drag({"aspect": aspect, "beta2": 0.1}, 20.0)

    for traced in (jax.jit(drag), jax.vmap(drag)):
        np.testing.assert_allclose(traced(jnp.asarray(aspects)), expected, rtol=1e-12)
