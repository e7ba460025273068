"""Surrogates on disk: scenes survive, and the one that ships is good."""

import json

import jax

from surrogate.body import Family
from surrogate.store import load_surrogate, read_scene, scene_record
from surrogate.training import loop


def test_scenes_survive_json(tiny_scene):
    assert read_scene(json.loads(json.dumps(scene_record(tiny_scene)))) == tiny_scene
    assert "unbounded" in tiny_scene.explain()


def test_pretrained_surrogate_on_unseen_bodies():
    """A handful of the acceptance test: mean error below 1 %, none above 5 %."""
    surrogate = load_surrogate("pretrained")
    domain = loop.scene_domain(surrogate.scene)
    samples = loop.draw_samples(surrogate.scene, jax.random.key(987), 12)
    labels = loop.require_converged(loop.solve_labels(domain, samples))
    errors = loop.drag_errors(surrogate.network, samples, -2 * labels.amplitude[:, 0])
    assert float(errors.mean()) < 0.01, errors
    assert float(errors.max()) < 0.05, errors
    assert surrogate.scene.family == Family()
