"""Surrogates on disk: scenes survive, and the one that ships is good."""

import dataclasses
import json

import jax
from train_surrogate import is_of

from surrogate.body.family import Family
from surrogate.model.store import BEST, load_surrogate, read_scene, scene_record
from surrogate.training import loop
from surrogate.training.presets import METHODS, preset


def test_scenes_survive_json(tiny_scene):
    assert read_scene(json.loads(json.dumps(scene_record(tiny_scene)))) == tiny_scene
    assert "unbounded" in tiny_scene.explain()


def test_the_shipped_surrogate_is_the_best_of_those_that_ship():
    shipped = {method: load_surrogate(f"pretrained:{method}") for method in METHODS}
    errors = {name: s.record["drag_error_mean"] for name, s in shipped.items()}
    assert min(errors, key=errors.get) == BEST
    assert len({s.network.weights.size for s in shipped.values()}) == 1
    assert len({s.record["samples"] for s in shipped.values()}) == 1


def test_a_surrogate_of_another_plan_is_not_taken_for_it():
    surrogate = load_surrogate("pretrained:sip")
    assert is_of(preset("sip", "full"), surrogate)
    for plan in (preset("sip", "quick"), preset("hig", "full"), preset("sip", "full", seed=1)):
        assert not is_of(plan, surrogate)
    for change in ({"iterations": 7}, {"added": [[], []]}):
        record = {**surrogate.record, **change}
        assert not is_of(preset("sip", "full"), dataclasses.replace(surrogate, record=record))


def test_pretrained_surrogate_on_unseen_bodies():
    """A handful of the acceptance test: mean error below 0.3 %, none above 1.5 %."""
    surrogate = load_surrogate("pretrained")
    domain = loop.scene_domain(surrogate.scene)
    samples = loop.draw_samples(surrogate.scene, jax.random.key(987), 12)
    labels = loop.require_converged(loop.solve_labels(domain, samples))
    errors = loop.drag_errors(surrogate.network, samples, -2 * labels.amplitude[:, 0])
    assert float(errors.mean()) < 0.003, errors
    assert float(errors.max()) < 0.015, errors
    assert surrogate.scene.family == Family()
