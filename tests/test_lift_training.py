"""Trainings of three loads: every method lowers the errors of Cd, Cl and Cm, in 2-D and 3-D."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import ROUGH_3D, TINY

from surrogate import Family, NotConverged, Scene
from surrogate.model.features import Wave, features_of
from surrogate.model.inputs import scene_inputs
from surrogate.model.network import blank_network
from surrogate.scene.samples import Samples, training_samples
from surrogate.training.loop import load_errors, run_training
from surrogate.training.methods.hig import LinearisedSlip, PublishedHalfInverseGradients
from surrogate.training.methods.labels import TrainingLabels, load_residuals
from surrogate.training.plan import METHODS, make_plan
from surrogate.training.setup import make_setup

SECTIONS = Family(aspect=(1.5, 3), gamma2=(-0.2, 0.3), incidence=(-4, 12))
SPHEROIDS = Family(dimension=3, aspect=(0.6, 2.0), incidence=(0, 90))
SCENES = {
    "sections": Scene(family=SECTIONS, fidelity=TINY, reynolds=(5, 20)),
    "spheroids": Scene(dimension=3, family=SPHEROIDS, fidelity=ROUGH_3D, reynolds=(1, 20)),
}
PARTICLES = {"aspect": (0.5, 3), "beta2": (-0.3, 0.3), "beta3": (-0.1, 0.1), "incidence": (0, 90)}
STEPS = {"dp": 60, "sip": 9, "hig": 8, "supervised": 9}


@pytest.fixture(scope="module", params=SCENES)
def start(request):
    """A plan of a scene, and the setup that all methods share."""
    plan = make_plan(SCENES[request.param], "sip", "quick", samples=12, held_out=8)
    return plan, make_setup(plan)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "published"),
    [*((method, False) for method in METHODS), ("sip", True), ("supervised", True)],
)
def test_every_method_learns_all_three_loads(start, method, published):
    plan, setup = start
    changes = {"iterations": STEPS[method], "report_every": STEPS[method], "published": published}
    trained = run_training(dataclasses.replace(plan, method=method, **changes), setup)
    assert trained.stopped is None

    def errors(network):
        return load_errors(network, setup.held_out, setup.labels.loads).mean(axis=0)

    before, after = errors(setup.network), errors(trained.network)
    assert np.all(after < (0.95 if published else 0.8) * before), (before, after)


@pytest.mark.slow
def test_a_training_whose_flows_are_all_lost_says_so(start):
    """The tractions of Oseen flows drive no steady flow of these sections at Re 5 to 20."""
    plan, setup = start
    if plan.scene.dimension == 3:
        pytest.skip("spheroids at Re from 1 have such flows")
    plan = dataclasses.replace(plan, method="hig", published=True, iterations=4, report_every=1)
    with pytest.raises(NotConverged, match="found none of 12 flows up to iteration 1"):
        run_training(plan, setup)


def test_a_quarter_of_the_training_bodies_in_space_is_symmetric_fore_and_aft():
    """Those at incidence, all over the ranges; other bodies are as the sequence has them."""
    scene = Scene(dimension=3, family=Family(3, **PARTICLES), reynolds=(0.1, 100))
    plan = make_plan(scene, "sip", samples=256)
    samples, plain = plan.training_samples, training_samples(scene, plan.seed, 256)
    even, odd = scene.family.names.index("beta2"), scene.family.names.index("beta3")
    symmetric = samples.parameters[:, even] == 0
    assert 0.15 < np.mean(symmetric) < 0.35
    shares = (samples.parameters - scene.family.bounds[:, 0]) / np.ptp(scene.family.bounds, axis=1)
    for chosen in (shares[symmetric][:, [0, odd, -1]], shares[~symmetric]):
        np.testing.assert_allclose(np.median(chosen, axis=0), 0.5, atol=0.15)
    np.testing.assert_array_equal(samples.parameters[~symmetric], plain.parameters[~symmetric])
    others = np.arange(len(scene.family.names)) != even
    np.testing.assert_array_equal(samples.parameters[:, others], plain.parameters[:, others])
    later = dataclasses.replace(plan, samples=20, infill=(200, 30)).training_samples
    np.testing.assert_array_equal(later.parameters[18:], samples.parameters[np.array([200, 30])])


@pytest.mark.parametrize(
    "changes", [{"beta2": (0.1, 0.3), "beta4": (-0.1, 0.1)}, {"incidence": None}]
)
def test_other_training_bodies_in_space_are_as_drawn(changes):
    """Where a range has no zero, as some bodies would cross themselves, and without incidence."""
    ranges = {name: r for name, r in (PARTICLES | changes).items() if r}
    scene = Scene(dimension=3, family=Family(3, **ranges), reynolds=(0.1, 100))
    plan = make_plan(scene, "sip", samples=32)
    drawn = training_samples(scene, plan.seed, 32)
    np.testing.assert_array_equal(plan.training_samples.parameters, drawn.parameters)


@pytest.mark.parametrize("reynolds", [1.0, 10.0, 100.0])
def test_an_error_of_the_moment_by_inertia_weighs_as_much_at_any_reynolds_number(reynolds):
    """Of a spheroid its residual is that of the head, and those of the gradients hardly differ."""
    family, change = Family(3, **PARTICLES), 1e-3
    scene = Scene(dimension=3, family=family, reynolds=(0.1, 100))
    network = blank_network(scene, (4, 4), jax.random.key(0))
    network = eqx.tree_at(lambda net: net.inputs, network, scene_inputs(scene))
    waves = [feature.wave for feature in features_of(family.body_class)]
    trend = network.trends[2].at[1 + waves.index(Wave.SIN_2)].add(change)
    moved = eqx.tree_at(lambda net: net.trends[2], network, trend)
    body = jnp.array([2.0, 0.0, 0.05, 30.0])
    samples = Samples(body[None], jnp.array([reynolds]))
    z = network.inputs(body, samples.reynolds[0])
    steepness = network.inputs.steepness(body)
    exact = network.outputs(z), jax.jacrev(network.outputs)(z) / steepness
    known, modes = jnp.ones(1, bool), jnp.zeros((1, network.modes.count))
    labels = TrainingLabels(modes, *(each[None] for each in exact), known, known)
    found = load_residuals(moved, samples, labels, jnp.array(0))
    turn = family.names.index("incidence")
    sine, cosine = np.sin(np.deg2rad(60)), np.cos(np.deg2rad(60))
    np.testing.assert_allclose(found[2, 0], change * sine, rtol=1e-9)
    np.testing.assert_allclose(found[2, 1 + turn], change * np.pi * cosine, rtol=1e-9)
    assert abs(found[2, -1]) < change * sine
    np.testing.assert_allclose(found[:2], 0.0, atol=1e-12)


def test_published_hig_leaves_samples_without_a_flow_out_of_its_step():
    """Another body in place of one whose flow was lost changes nothing, its moment neither."""
    scene, rng = SCENES["sections"], np.random.default_rng(0)
    network = blank_network(scene, (4, 4), jax.random.key(0))
    network = eqx.tree_at(lambda net: net.inputs, network, scene_inputs(scene))
    modes, found = network.modes.count, np.array([1.0, 0.0])
    labels = LinearisedSlip(
        jnp.asarray(found[:, None] * rng.normal(size=(2, modes + 1))),
        jnp.asarray(found[:, None, None] * rng.normal(size=(2, modes + 1, modes))),
    )
    method, steps = PublishedHalfInverseGradients(), []
    for other in ([2.5, -0.1, 4.0], [1.7, 0.2, 9.0]):
        samples = Samples(jnp.array([[2.0, 0.1, 8.0], other]), jnp.array([10.0, 8.0]))
        arguments = jnp.array(0), labels, samples, jnp.arange(2), jnp.array(0.0)
        steps.append(method.update(network, *arguments)[0].weights - network.weights)
    assert np.abs(steps[0]).max() > 1e-3
    np.testing.assert_allclose(steps[0], steps[1], rtol=1e-9, atol=1e-12)
