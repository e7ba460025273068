"""Invalid input is refused by the library in one line; numbers of every type are accepted."""

import dataclasses
from decimal import Decimal
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TINY

from shapeopt import LogNormal, Problem, Robust, Station, Weighted, optimise, save_run, verify
from shapeopt.free_fall import fall
from shapeopt.payoff.queries import query_stream
from surrogate import (
    FIDELITIES,
    Family,
    Flow,
    InvalidInput,
    Particle,
    Scene,
    Tunnel,
    contour_shape,
    export,
    family_shape,
    load,
    naca4,
    save,
    train,
)
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.samples import training_samples

BODY = [2.0, 0.1, 0.0, 0.0]


@pytest.fixture(scope="module")
def net():
    return load("pretrained")


T = np.linspace(0, 2 * np.pi, 80, endpoint=False)
ROUND = np.stack([np.cos(T), 0.5 * np.sin(T)], axis=1)
CROSSING = [2.0, 0.9, 0.0, 0.0]
INVALID_BODIES = [
    [2.0, 0.1, 0.0],
    [*BODY, 0.0],
    "abcd",
    None,
    {"beta2": 0.1},
    [2.0, "0.1", 0, 0],
    [BODY],
]


@pytest.mark.parametrize("bad", INVALID_BODIES, ids=str)
def test_invalid_bodies_are_refused(net, bad, unchecked):
    flow = Flow(Scene(fidelity="draft"))
    for function in (net.outside, flow.loads_and_gradients):
        with pytest.raises(InvalidInput):
            function(bad, 20.0)
    with pytest.raises(InvalidInput):
        verify(Problem(net.scene, 20.0), bad)


def test_calls_for_one_and_many_check_bodies_and_reynolds_numbers(unchecked):
    flow = Flow(Scene(fidelity="draft"))
    for body, reynolds in (
        ([-1.0, 0.1, 0, 0], 20.0),
        (BODY, -1.0),
        (BODY, 200.0),
        (CROSSING, 20.0),
        ([9.0, 0.0, 0.0, 0.0], 20.0),
        (BODY, np.nan),
    ):
        with pytest.raises(InvalidInput):
            flow.loads_and_gradients(body, reynolds)
        with pytest.raises(InvalidInput):
            flow.solve_all(np.array([body]), np.array([reynolds]))
    for numbers in ([1.0, 2.0], "20", [None]):
        with pytest.raises(InvalidInput, match="1 numbers are needed, or one for all"):
            flow.solve_all(np.array([BODY]), numbers)


def test_calls_for_one_and_many_refuse_the_unsteady_unless_asked():
    same_grid = dataclasses.replace(TINY, refinement=1.0)
    flow, round_body = Flow(Scene(reynolds=(1, 60), fidelity=same_grid)), [1.0, 0.0, 0.0, 0.0]
    with pytest.raises(InvalidInput, match=r"unstable beyond 4\d"):
        flow.loads_and_gradients(round_body, 55.0)
    with pytest.raises(InvalidInput, match=r"number 55: .* unstable beyond 4\d"):
        flow.solve_all(np.array([BODY, round_body]), [30.0, 55.0])
    one = flow.loads_and_gradients(round_body, 55.0, allow_unsteady=True)
    many = flow.solve_all(np.array([round_body] * 2), 55.0, allow_unsteady=True)
    np.testing.assert_allclose(many.drag, float(one.drag), rtol=1e-5)


def test_reynolds_numbers_below_those_of_the_far_field_are_refused():
    """Convection is felt at distances of 1 / Re; a scene of lower Re has a larger far field."""
    flow = Flow(Scene(reynolds=(1, 40), fidelity=TINY))
    for call in (flow.drag, flow.loads_and_gradients, flow.solve):
        with pytest.raises(InvalidInput, match=r"number 0\.1: .* far field .* from Re 0\.2604 on"):
            call(BODY, 0.1)
    with pytest.raises(InvalidInput, match=r"number 0\.1: "):
        flow.solve_all(np.array([BODY, BODY]), [20.0, 0.1])
    for scene in (Scene(reynolds=(0.01, 1)), Scene(stream="tunnel:8", fidelity=TINY)):
        assert Flow(scene).domain.least_reynolds <= 0.01


@pytest.mark.parametrize("bad", [0, -1, "20", None, [10, 20], np.bool_(True), np.nan, 10**400])
def test_invalid_reynolds_numbers_are_refused(net, bad, unchecked):
    with pytest.raises(InvalidInput):
        net.outside(BODY, bad)


def test_traced_batches_are_refused_by_the_flow_with_a_hint_to_vmap(net):
    flow = Flow(Scene(fidelity="draft"))
    with pytest.raises(InvalidInput, match=r"jax\.vmap"):
        jax.jit(flow.drag)(jnp.array([BODY]), jnp.array([20.0]))
    for model in (net, flow):
        with pytest.raises(InvalidInput, match=r"\(4,\)"):
            jax.jit(model.drag)(jnp.array(BODY[:3]), jnp.asarray(20.0))
    with pytest.raises(InvalidInput, match=r"\(3, 4\) and \(2,\)"):
        jax.jit(net.drag)(jnp.array([BODY] * 3), jnp.ones(2))


WRONG_TYPES = {
    "optimise": lambda net: optimise("x", net),
    "stations": lambda net: Problem(net.scene, 20.0, stations=[0.5]),
    "within": lambda net: Problem(net.scene, 20.0, within="aspect"),
    "list of numbers": lambda net: Weighted(10, 40),
    r"aspect \[\[1.0\].*: must be": lambda net: net.drag({"aspect": [[1.0], [1.0, 2.0]]}, 20.0),
    "no aspect;": lambda net: net.drag({"beta2": np.zeros(3)}, 20.0),
    "incidence is none": lambda net: net.drag({"aspect": np.ones(2), "incidence": [0, 5]}, 20.0),
    r"aspect \(2,\), beta2 \(3,\)": lambda net: net.drag(
        {"aspect": [1, 2], "beta2": [0, 0, 0]}, 20.0
    ),
    r"beta2 \[.*\]: must be": lambda net: net.drag({"aspect": 2.0, "beta2": ["a", "b"]}, 20.0),
    "no aspect": lambda net: family_shape({"beta2": 0.1}),
    "no parameter": lambda net: family_shape({"aspect": 2, "beta13": 0.1}),
    "path": lambda net: load(5),
    "density": lambda net: Particle("heavy", 1e-6, 1e-4),
    "viscosity": lambda net: Particle(2.0, 1e-300, 1e-4),
    "shape": lambda net: contour_shape(np.ones((12, 2)) * 1j),
    "points": lambda net: contour_shape(np.ones((0, 2))),
    "masked": lambda net: contour_shape(np.ma.masked_less(ROUND, 0.5)),
    "aspect, beta2": lambda net: net.scene.family.parameters({}),
    "aspect '2'": lambda net: net.scene.family.parameters({"aspect": "2"}),
    "dimension 4": lambda net: family_shape({"aspect": 2}, 0, 4),
    "count -1": lambda net: net.scene.family.sample(jax.random.key(0), -1),
    "fidelity": lambda net: Fidelity(None, 8, 3, 4, 4),
    "range of aspect": lambda net: Family(aspect=np.array(5)),
    "Reynolds range": lambda net: Scene(reynolds=np.array(40)),
    "one number, and these": lambda net: Weighted([10, [20, 30]], [1, 1]),
    "a list of numbers": lambda net: Weighted(np.array(5.0), np.array(1.0)),
    "preset": lambda net: train(preset=[]),
    "dimension array": lambda net: Scene(dimension=np.array([2, 3])),
    "until": lambda net: optimise(Problem(net.scene, 20), net, until=np.array(["a", "b"])),
    "points -5": lambda net: naca4("0012", -5),
    "NewtonSettings": lambda net: Flow(net.scene, settings="x"),
    "too long": lambda net: load("x" * 5000),
    "pretrained:sip": lambda net: load("pretrained:nope"),
    "path ''": lambda net: load(""),
    "no valid file name": lambda net: load("\udcff"),
    "number": lambda net: net.drag(BODY, np.array("20")),
    "body": lambda net: net.drag(jax.random.key(0), 20.0),
    "traced as key": lambda net: jax.jit(lambda key: net.drag(key, 20.0))(jax.random.key(0)),
    "one number": lambda net: net.drag(BODY, np.array(True)),
    "must be numbers": lambda net: net.drag([2.0, False, 0, 0], 20.0),
    "jax.numpy array": lambda net: jax.grad(lambda a: net.drag([a, 0.1, 0, 0], 20.0))(2.0),
    "complex128": lambda net: jax.jit(net.drag)(jnp.array(BODY) + 1j, 20.0),
    "'20'": lambda net: jax.jit(lambda body: net.drag(body, "20"))(jnp.array(BODY)),
    "'2'": lambda net: jax.jit(lambda re: net.drag(["2", "0", "0", "0"], re))(20.0),
    "million cells": lambda net: Fidelity("", 128, 80, 80, 80),
    "23.0 million cells; up to 16": lambda net: fitted_domain(
        Tunnel(60.0), Fidelity("", 40, 20, 40, 30), contour_shape(naca4("0012")), 60.0
    ),
    "path ": lambda net: Scene.read(b"x"),
    "save": lambda net: save("x", None),
    "export": lambda net: export("pretrained", "s.c"),
    "prefix": lambda net: export(net, "s.c", prefix=5),
    "prefix: goes with C": lambda net: export(net, "s.py", "numpy", prefix="drag"),
    "of each 4 parameters": lambda net: net.drag([[]], 20.0),
    "min moment 0.2 is above max": lambda net: Problem(
        load("pretrained:lift").scene, 20.0, min_moment=0.2, max_moment=0.1
    ),
    "4 parameters are needed": lambda net: fall(
        load("pretrained:particle"), [2.0, 1.0], Particle(1.2, 1e-6, 4e-4), 1.0
    ),
    "surface points": lambda net: Flow(net.scene).solve(BODY, 20.0, estimate=False).surface(1.5),
    "save_run": lambda net: save_run("x", None),
    "four digits": lambda net: naca4(12),
    "bodies 'x'": lambda net: net.scene.explain("x"),
    "real numbers": lambda net: contour_shape([[1, 2], [3]]),
    "published 'no': must be True or False": lambda net: train(published="no"),
    "overwrite 'no'": lambda net: train(overwrite="no"),
    "extrapolate 1": lambda net: net.drag(BODY, 20.0, extrapolate=1),
    "allow_unsteady 'no'": lambda net: Flow(net.scene).drag(BODY, 20.0, allow_unsteady="no"),
    "partial 'no'": lambda net: Flow(net.scene).solve_all([BODY], 20.0, partial="no"),
    "estimate 0": lambda net: Flow(net.scene).solve(BODY, 20.0, estimate=0),
    "by_chord 'no'": lambda net: Problem(net.scene, 20.0, by_chord="no"),
    "this is the one of 2-D flows": lambda net: Scene(dimension=3, fidelity=FIDELITIES["standard"]),
    "body: traced by JAX": lambda net: jax.jit(
        lambda reynolds: Flow(net.scene).solve(BODY, reynolds).drag
    )(20.0),
}


@pytest.mark.parametrize("words", WRONG_TYPES)
def test_wrong_types_are_refused_in_one_line(net, words, unchecked):
    with pytest.raises(InvalidInput, match=words.strip()) as refusal:
        WRONG_TYPES[words](net)
    assert len(str(refusal.value).splitlines()) == 1


def test_numbers_of_every_type_are_accepted(net, unchecked):
    plain = float(net.drag(BODY, 20.0))
    for body, reynolds in (
        ([Decimal(2), Fraction(1, 10), 0, np.float32(0)], Fraction(20)),
        (np.array(BODY), np.float16(20)),
        ((2, np.array(0.1), jnp.array(0.0), 0), np.int8(20)),
    ):
        assert net.drag(body, reynolds) == pytest.approx(plain, rel=1e-12)
    exact = {"max_length": Fraction(9, 5), "trust": Decimal("0.01")}
    stations = (Station(Fraction(1, 2), Decimal("0.3")),)
    robust = Robust(Decimal(20), LogNormal(Decimal("0.2")), cases=4)
    found = Problem(net.scene, robust, stations=stations, **exact)
    usual = {"max_length": 1.8, "trust": 0.01, "stations": (Station(0.5, 0.3),)}
    same = Problem(net.scene, Robust(20.0, LogNormal(0.2), cases=4), **usual)
    assert found == same
    for ours, theirs in ((found.limits, same.limits), (found.scenarios, same.scenarios)):
        jax.tree.map(np.testing.assert_array_equal, ours, theirs)


def test_a_body_that_crosses_itself_has_drag_nan_under_jit(net):
    crossing = jnp.array([1.0, -0.3, -0.15, -0.1])  # within the trained ranges
    with pytest.raises(InvalidInput, match="cross"):
        net.drag(crossing, 20.0)
    for extrapolate in (False, True):
        drag = jax.jit(lambda body, e=extrapolate: net.drag(body, 20.0, extrapolate=e))
        assert np.isnan(drag(crossing))
        assert np.isfinite(drag(jnp.array(BODY)))


def test_huge_weights_are_normalised(net):
    scenarios = Weighted((10, 40), (1e308, 1e308)).scenarios(net.scene)
    assert scenarios.weight == pytest.approx([0.5, 0.5])


def test_a_family_whose_bodies_all_cross_is_refused_for_few_samples_too():
    family = Family(aspect=(1, 3), beta2=(0.9, 1.0))
    with pytest.raises(InvalidInput, match="nearly all"):
        training_samples(Scene(family=family), 0, 4)


def test_a_stream_of_no_queries_is_empty(net):
    assert query_stream(net.scene, 0, 0) == []
