"""The bounds that a surrogate states for its errors."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import shipped

from surrogate import Family, Flow, load
from surrogate.errors import InvalidInput
from surrogate.model.confidence import Novelty, coverage, error_scales
from surrogate.scene.samples import held_out_samples
from surrogate.training.history import load_errors


def test_scales_are_the_conformal_quantile():
    errors = np.arange(1.0, 40.0)[:, None] * [1.0, 2.0]
    novelty = np.ones((39, 2)) * [1.0, 4.0]
    # of 39 ratios the one of rank ceil(40 * 0.95) = 38
    np.testing.assert_allclose(error_scales(errors, novelty), [38.0, 19.0])
    np.testing.assert_allclose(error_scales(errors[:5], novelty[:5]), [5.0, 2.5])


def test_few_held_out_bodies_cover_less_than_95_per_cent():
    assert [coverage(count) for count in (4, 19, 128)] == [0.8, 0.95, 0.95]
    surrogate = load("pretrained")
    few = dataclasses.replace(surrogate, record=surrogate.record | {"held_out": 9})
    assert [one.bound_coverage for one in (surrogate, few)] == [0.95, 0.9]


@pytest.mark.parametrize("count", [5, 600], ids=["fewer than weights", "more than weights"])
def test_exact_novelty_is_the_deviation_of_the_linearised_model(count):
    net, ridge_over_mean_square = shipped("pretrained:sip").network, 1e-4
    samples = held_out_samples(shipped("pretrained:sip").scene, 9, count + 2)

    def gradient(parameters, reynolds):
        def log_drag(weights):
            return jnp.log(net.with_load_weights(weights).drag(parameters, reynolds))

        return jax.grad(log_drag)(net.load_weights)

    rows = np.asarray(jax.jit(jax.vmap(gradient))(*samples))
    known, others = rows[:count], rows[count:]
    ridge = ridge_over_mean_square * np.mean(np.sum(known**2, axis=1))
    matrix = known.T @ known / ridge + np.eye(known.shape[1])
    variances = np.einsum("kw,kw->k", others, np.linalg.solve(matrix, others.T).T)
    novelty = Novelty.of(net, samples.head(count))
    assert len(novelty.factor) == min(known.shape)
    found = jax.vmap(novelty)(*samples.at(np.arange(count, count + 2)))
    np.testing.assert_allclose(found[:, 0], np.sqrt(variances), rtol=1e-8)


@pytest.mark.parametrize("name", ["pretrained", "pretrained:lift", "pretrained:particle"])
def test_bounds_grow_towards_the_ends_of_the_ranges(name):
    net = shipped(name)
    samples = held_out_samples(net.scene, 77, 256)
    low, high = net.ranges.bounds.T
    values = np.column_stack([samples.parameters, np.log(samples.reynolds)])
    distance = np.linalg.norm((2 * values - low - high) / (high - low), axis=1)
    bounds = net.error_bounds(*samples.at(np.argsort(distance)))
    assert bounds.shape == (256, 3)
    loads = 1 if net.scene.family.body_class.symmetric else 3
    assert np.all(bounds[:, :loads] > 0)
    assert not bounds[:, loads:].any()
    near, far = (np.median(part[:, :loads], axis=0) for part in (bounds[:64], bounds[-64:]))
    assert np.all(near < far)


@pytest.fixture(scope="module")
def unseen():
    """Two sets of bodies, and their drags by the flow, of one batch."""
    scene = shipped("pretrained").scene
    both = held_out_samples(scene, 5, 32), held_out_samples(scene, 987, 12)
    bodies, reynolds = map(np.concatenate, zip(*both, strict=True))
    drags = Flow(scene).solve_all(bodies, reynolds, allow_unsteady=True).drag
    return (both[0], drags[:32]), (both[1], drags[32:])


def test_golden_pretrained_surrogate_on_unseen_bodies(unseen):
    """A handful of the acceptance test: mean error below 0.05 %, none above 0.3 %."""
    net, (samples, drags) = shipped("pretrained"), unseen[1]
    errors = load_errors(net.network, samples, jnp.asarray(drags)[:, None])[:, 0]
    assert float(errors.mean()) < 0.0005, errors
    assert float(errors.max()) < 0.003, errors
    assert net.scene.family == Family()


def test_bounds_hold_for_bodies_drawn_anew(unseen):
    net = shipped("pretrained")
    samples, drags = unseen[0]
    errors = np.abs(np.asarray(net.drag(*samples) / drags) - 1)
    # at a coverage of 95 %, fewer than 26 of 32 have a chance below 1e-4
    bounds = net.error_bounds(*samples)[:, 0]
    assert np.sum(errors <= bounds) >= 26
    assert np.median(bounds) < 20 * np.median(errors)  # they are of the size of the errors


def test_bounds_of_one_body_are_those_in_a_batch():
    net = shipped("pretrained:lift")
    samples = held_out_samples(net.scene, 3, 4)
    one = net.error_bounds(samples.parameters[2], samples.reynolds[2])
    np.testing.assert_allclose(one, net.error_bounds(*samples)[2], rtol=1e-6)


def test_bounds_of_many_bodies_are_computed_in_parts(monkeypatch):
    net = shipped("pretrained:sip")
    samples = held_out_samples(net.scene, 4, 14)
    whole = net.error_bounds(*samples)
    monkeypatch.setattr("surrogate.model.evaluation.MOST_BODIES", 4)
    np.testing.assert_allclose(net.error_bounds(*samples), whole, rtol=1e-9)
    bodies, numbers = samples.parameters.reshape(7, 2, -1), np.array([5.0, 30.0])
    parts = net.error_bounds(bodies, numbers)
    assert parts.shape == (7, 2, 3)
    np.testing.assert_allclose(parts[3, 1], net.error_bounds(bodies[3, 1], 30.0), rtol=1e-9)


@pytest.mark.parametrize("transform", [jax.jit, jax.vmap])
def test_bounds_are_not_for_transformed_functions(transform):
    net = shipped("pretrained:sip")
    with pytest.raises(InvalidInput, match="call it outside"):
        transform(lambda re: net.error_bounds([2.0, 0, 0, 0], re))(np.array([10.0]))


def test_bounds_outside_the_ranges_are_refused():
    net = shipped("pretrained")
    with pytest.raises(InvalidInput, match="outside the trained ranges: Reynolds number 44"):
        net.error_bounds([2.0, 0.0, 0.0, 0.0], 44.0)
