"""Infill: further training samples are drawn where a surrogate knows least."""

import dataclasses

import numpy as np
import pytest

from surrogate import InvalidInput, load
from surrogate.model.confidence import Novelty
from surrogate.scene.samples import training_samples
from surrogate.training.infill import infill_positions
from surrogate.training.loop import make_setup, run_training
from surrogate.training.plan import Plan, make_plan
from surrogate.training.record import plan_differences, surrogate_of
from surrogate.training.train import train_plan


@pytest.fixture(scope="module")
def trained(tiny_scene):
    """A surrogate of few samples."""
    plan = Plan("sip", tiny_scene, samples=12, held_out=8, iterations=4, report_every=2)
    setup = make_setup(plan)
    return surrogate_of(plan, run_training(plan, setup), setup)


def test_the_first_choice_has_the_largest_bound():
    net = load("pretrained:lift")
    own = net.record["samples"]
    [first] = infill_positions(net, net.scene, net.record["seed"], own + 1)
    drawn = training_samples(net.scene, net.record["seed"], own + 2048)
    bounds = net.error_bounds(*drawn.at(np.arange(own, own + 2048))).max(axis=1)
    assert first == own + np.argmax(bounds)


def test_what_is_added_is_known_then(tiny_scene, trained):
    """Bounds at all choices fall far, and choices are neither repeated nor among the samples."""
    positions = infill_positions(trained, tiny_scene, 0, 20)
    assert len(set(positions)) == 8
    assert min(positions) >= 12
    chosen = training_samples(tiny_scene, 0, 8, positions)
    after = Novelty.of(trained.network, training_samples(tiny_scene, 0, 20, positions))
    for sample in zip(*map(np.asarray, chosen), strict=True):
        assert after(*sample)[0] < 0.2 * trained.novelty(*sample)[0]


def test_samples_are_those_before_and_the_infill(tiny_scene):
    samples = training_samples(tiny_scene, 0, 6, (9, 7))
    sequence = training_samples(tiny_scene, 0, 10)
    np.testing.assert_array_equal(samples.parameters[4:], sequence.parameters[np.array([9, 7])])
    np.testing.assert_array_equal(samples.reynolds[:4], sequence.reynolds[:4])


def test_a_refined_training_is_kept_and_refined_again(tiny_scene, trained, tmp_path):
    plan = make_plan(tiny_scene, "sip", samples=16, held_out=8, refine=trained)
    plan = dataclasses.replace(plan, iterations=4, report_every=2)
    refined = train_plan(plan, tmp_path / "refined", progress=False)
    assert refined.record["infill"] == list(plan.infill)
    assert len(plan.infill) == 4
    stored = load(tmp_path / "refined")
    assert not plan_differences(plan, stored.record)
    assert "infill" in plan_differences(dataclasses.replace(plan, infill=()), stored.record)
    again = train_plan(plan, tmp_path / "refined", progress=False)
    np.testing.assert_array_equal(again.network.weights, refined.network.weights)
    more = infill_positions(stored, tiny_scene, 0, 20)
    assert more[:4] == plan.infill
    assert len(set(more)) == 8
    np.testing.assert_array_equal(
        stored.training_samples.parameters[12:],
        training_samples(tiny_scene, 0, 4, plan.infill).parameters,
    )


@pytest.mark.parametrize(
    ("seed", "count", "wanted"),
    [(1, 20, "another scene or seed"), (0, 12, "a surrogate of 12 samples; ask for more")],
)
def test_what_cannot_be_refined_is_refused(tiny_scene, trained, seed, count, wanted):
    with pytest.raises(InvalidInput, match=f"refine: .*{wanted}"):
        make_plan(tiny_scene, "sip", samples=count, seed=seed, refine=trained)


def test_a_surrogate_of_another_scene_is_refused(tiny_scene):
    with pytest.raises(InvalidInput, match="another scene"):
        make_plan(tiny_scene, "sip", samples=512, refine=load("pretrained:lift"))
