"""Plans of trainings: invalid arguments are refused, the cost is forecast."""

import numpy as np
import pytest

from surrogate import InvalidInput, load, train
from surrogate.scene.samples import shuffled_batches
from surrogate.training.forecast import forecast
from surrogate.training.plan import METHODS, make_plan


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "magic"}, "one of dp, sip, hig, supervised"),
        ({"method": "dp", "preset": "huge"}, "one of quick, full"),
        ({"method": "dp", "budget_seconds": -1}, "budget"),
        ({"method": "dp", "budget_seconds": np.nan}, "budget in seconds nan: must be a finite"),
        ({"method": "dp", "budget_seconds": "60"}, "must be one number"),
        ({"method": "dp", "samples": 2}, "a whole number from 4"),
        ({"method": "dp", "samples": 8.5}, "a whole number from 4"),
        ({"method": "dp", "held_out": 3}, "held-out bodies 3: a whole number from 4"),
        ({"method": "dp", "seed": -1}, "a whole number from 0"),
        ({"method": "dp", "width": 0}, "width 0: a whole number from 1"),
        ({"method": "dp", "width": 129}, "width 129: a whole number from 1 to 128"),
        ({"method": "dp", "scene": "scene.toml"}, "is no Scene"),
    ],
)
def test_plans_name_what_is_wrong(options, words, unchecked):
    with pytest.raises(InvalidInput, match=words):
        make_plan(**{"scene": None, **options})
    with pytest.raises(InvalidInput, match=words):
        train(**options)


@pytest.mark.parametrize("name", [*METHODS, "space", "lift", "particle"])
def test_forecast_of_the_work_comes_true(name):
    """Within a factor of 1.5 of what the shipped surrogate took, or that which chose its infill.

    Forecasts are averages over random bodies; bodies of an infill take more.
    """
    shipped = load(f"pretrained:{name}")
    infill = len(shipped.record.get("infill") or ())
    method, samples = shipped.recorded("method"), shipped.recorded("samples") - infill
    foreseen = forecast(make_plan(shipped.scene, method, samples=samples))
    took = shipped.recorded("earlier_green_applications" if infill else "green_applications")
    assert took / 1.5 < foreseen.green_applications < 1.5 * took
    assert foreseen.seconds > 0


def test_the_usual_width_of_the_layers_may_be_named(tiny_scene):
    assert make_plan(tiny_scene, "sip", width=20) == make_plan(tiny_scene, "sip")
    assert make_plan(tiny_scene, "sip", width=7) != make_plan(tiny_scene, "sip")


def test_held_out_flows_are_forecast_apart(tiny_scene):
    """They come on top: the cost of the training itself does not depend on their number."""
    few, many = (forecast(make_plan(tiny_scene, "sip", samples=8, held_out=n)) for n in (4, 40))
    assert few.green_applications == many.green_applications
    assert 0 < 2 * few.held_out_s < many.held_out_s


def test_a_budget_bounds_the_forecast(tiny_scene):
    plan = make_plan(tiny_scene, "hig", samples=4, published=True, budget_seconds=20)
    foreseen = forecast(plan)
    assert 0 < foreseen.flow_s <= 20
    assert foreseen.network_s <= 20
    assert 4 < foreseen.green_applications < 20 / 1e-5  # no convolution takes ten microseconds


@pytest.mark.parametrize("method", METHODS)
def test_few_steps_evaluate_all_of_many_samples(method):
    """As often as labels by two Newton steps at a time need; presets have the batches as tuned."""
    for samples in (179, 449, 2001, 4096):
        plan = make_plan(None, method, "quick", samples=samples)
        batches = shuffled_batches(0, samples, plan.make_method().batch)
        evaluated = np.zeros(samples, int)
        for iteration in range(plan.iterations):
            evaluated[batches(iteration)] += 1
        assert evaluated.min() >= 4
    usual = {"dp": 64, "sip": 8, "hig": 1024, "supervised": 8}[method]
    for changes in ({"preset": "quick"}, {"samples": 4096, "budget_seconds": 60}):
        assert make_plan(None, method, **changes).make_method().batch == usual
    published = {"dp": 4, "hig": 32}
    if method in published:
        plan = make_plan(None, method, published=True, samples=4096)
        assert plan.make_method().batch == published[method]
