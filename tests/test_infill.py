"""Infill: further training samples are drawn where a surrogate knows least."""

import dataclasses

import jax
import numpy as np
import pytest

from surrogate import InvalidInput, load
from surrogate.model.confidence import Novelty
from surrogate.model.surrogate import Surrogate
from surrogate.scene.samples import training_samples
from surrogate.training.infill import infill_positions
from surrogate.training.plan import make_plan
from surrogate.training.record import plan_differences
from surrogate.training.train import train_plan


@pytest.fixture(scope="module")
def few(tiny_scene):
    """A surrogate as if it were trained on few samples."""
    shipped = load("pretrained:sip")
    record = shipped.record | tiny_scene.record | {"samples": 12, "infill": []}
    return Surrogate(shipped.network, tiny_scene, record)


def test_every_choice_has_the_largest_bound_given_those_before_it(monkeypatch):
    monkeypatch.setattr("surrogate.training.infill.CANDIDATES", 128)
    shipped, own = load("pretrained:lift"), 128  # as if trained on fewer, without infill
    record = shipped.record | {"samples": own, "infill": []}
    net, seed = Surrogate(shipped.network, shipped.scene, record), shipped.record["seed"]
    positions = infill_positions(net, net.scene, seed, own + 2)
    candidates = training_samples(net.scene, seed, 2 * own).at(np.arange(own, 2 * own))
    scales = [net.record[f"{name}_error_scale"] for name in ("drag", "lift", "moment")]
    for k, position in enumerate(positions):
        known = training_samples(net.scene, seed, own + k, positions[:k])
        novelty = Novelty.of(net.network, known)
        bounds = (np.asarray(jax.vmap(novelty)(*candidates)) * scales).max(axis=1)
        assert bounds[position - own] == pytest.approx(bounds.max(), rel=1e-3)


@pytest.mark.slow
def test_what_is_added_is_known_then(tiny_scene, few):
    """Bounds at all choices fall far, and choices are neither repeated nor among the samples."""
    positions = infill_positions(few, tiny_scene, 0, 20)
    assert len(set(positions)) == 8
    assert min(positions) >= 12
    chosen = training_samples(tiny_scene, 0, 8, positions)
    after = Novelty.of(few.network, training_samples(tiny_scene, 0, 20, positions))
    for sample in zip(*map(np.asarray, chosen), strict=True):
        assert after(*sample)[0] < 0.2 * few.novelty(*sample)[0]


def test_samples_are_those_before_and_the_infill(tiny_scene):
    samples = training_samples(tiny_scene, 0, 6, (9, 7))
    sequence = training_samples(tiny_scene, 0, 10)
    np.testing.assert_array_equal(samples.parameters[4:], sequence.parameters[np.array([9, 7])])
    np.testing.assert_array_equal(samples.reynolds[:4], sequence.reynolds[:4])


def test_a_training_with_infill_is_kept_and_goes_on(tiny_scene, few, tmp_path):
    plan = make_plan(tiny_scene, "sip", samples=16, held_out=8, infill_from=few)
    plan = dataclasses.replace(plan, iterations=4, report_every=2)
    refined = train_plan(plan, tmp_path / "refined", progress=False)
    assert refined.record["infill"] == list(plan.infill)
    before = few.record["green_applications"]
    assert refined.record["earlier_green_applications"] == before > 0
    assert len(plan.infill) == 4
    stored = load(tmp_path / "refined")
    assert not plan_differences(plan, stored.record)
    assert "infill" in plan_differences(dataclasses.replace(plan, infill=()), stored.record)
    again = train_plan(plan, tmp_path / "refined", progress=False)
    np.testing.assert_array_equal(again.network.weights, refined.network.weights)
    more = make_plan(tiny_scene, "sip", samples=20, infill_from=stored)
    before += stored.record["green_applications"]
    assert more.earlier_green_applications == before
    assert more.infill[:4] == plan.infill
    assert len(set(more.infill)) == 8
    np.testing.assert_array_equal(
        stored.training_samples.parameters[12:],
        training_samples(tiny_scene, 0, 4, plan.infill).parameters,
    )


@pytest.mark.parametrize(
    ("seed", "count", "wanted"),
    [
        (1, 20, "of another scene or seed .seed 0, not 1"),
        (0, 12, "from 13 to 2060 samples in all .* has 12; not 12"),
        (0, 2061, "from 13 to 2060 .* not 2061"),
    ],
)
def test_what_infill_cannot_start_from_is_refused(tiny_scene, few, seed, count, wanted):
    with pytest.raises(InvalidInput, match=f"infill: .*{wanted}"):
        make_plan(tiny_scene, "sip", samples=count, seed=seed, infill_from=few)


def test_a_surrogate_of_another_scene_is_refused(tiny_scene):
    with pytest.raises(InvalidInput, match=r"another scene or seed \(reynolds"):
        make_plan(tiny_scene, "sip", samples=512, infill_from=load("pretrained:lift"))
