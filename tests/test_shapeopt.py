"""Shape optimisation, payoff arithmetic, and pictures that are not blank."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest

from shapeopt.problem.constraints import margins
from surrogate.body.measures import chord, thickness
from shapeopt.search.optimise import optimise
from shapeopt.payoff.payoff import Campaign, Cost, Design, break_even, payoff
from shapeopt.payoff.plot import plot_payoff
from shapeopt.problem.problem import Problem
from shapeopt.payoff.queries import query_stream
from shapeopt.render.pictures import pv
from shapeopt.search.verify import verify
from surrogate.body.family import family_markers
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Tunnel
from surrogate.model.store import load_surrogate


@pytest.fixture(scope="module")
def pretrained():
    return load_surrogate("pretrained")


def test_optimum_is_no_worse_than_any_candidate(pretrained):
    problem = Problem(pretrained.scene, 20.0)
    optimum = optimise(problem, pretrained)
    drags = [float(pretrained.drag(jnp.asarray(p), 20.0)) for p in problem.candidates()[::50]]
    assert optimum.drag <= min(drags) + 1e-9
    assert optimum.calls > len(drags)


def test_optimum_is_stationary_inside_its_bounds(pretrained):
    """Move each free parameter a little: the predicted drag does not fall."""
    optimum = optimise(Problem(pretrained.scene, 1.0), pretrained)
    low, high = pretrained.scene.family.bounds.T
    for k in range(4):
        for step in (-0.01, 0.01):
            moved = optimum.parameters.copy()
            moved[k] = np.clip(moved[k] + step * (high - low)[k], low[k], high[k])
            assert float(pretrained.drag(jnp.asarray(moved), 1.0)) >= optimum.drag - 1e-6


@pytest.mark.parametrize(("length", "thick"), [(1.5, None), (None, 0.9), (1.4, 0.8)])
def test_constraints_hold_at_the_optimum(pretrained, length, thick):
    problem = Problem(pretrained.scene, 40.0, length, thick)
    optimum = optimise(problem, pretrained)
    assert np.all(np.asarray(margins(optimum.parameters, problem.limits)) >= -1e-6)
    free = optimise(Problem(pretrained.scene, 40.0), pretrained)
    assert optimum.drag >= free.drag - 1e-9


def test_measures_of_a_body():
    body = jnp.array([4.0, 0, 0, 0])
    markers = np.asarray(family_markers(body, 400))
    assert float(chord(body)) == pytest.approx(np.ptp(markers[:, 0]))
    assert float(thickness(body)) == pytest.approx(np.ptp(markers[:, 1]))


def test_impossible_problems_name_the_constraint(pretrained):
    with pytest.raises(InvalidInput, match="max length"):
        Problem(pretrained.scene, 20.0, max_length=0.5).candidates()
    with pytest.raises(InvalidInput, match="min thickness 3"):
        Problem(pretrained.scene, 20.0, min_thickness=3.0).candidates()
    with pytest.raises(InvalidInput, match="covers 1 to 40"):
        Problem(pretrained.scene, 41.0)


def test_break_even():
    assert break_even(100.0, 1.0, 5.0) == 25.0
    assert break_even(100.0, 5.0, 1.0) == math.inf


def example_payoffs():
    designs = [
        Design(Cost(1, 10), 1.01, Cost(3, 110), 1.0),
        Design(Cost(1, 10), 1.03, Cost(5, 90), 1.0),
    ]
    return [payoff("sip", [Campaign(Cost(30, 900), 0.01, 0.02, designs)])]


def test_payoff_of_known_designs():
    p = example_payoffs()[0]
    assert p.gap_mean == pytest.approx(0.02)
    assert p.gap_max == pytest.approx(0.03)
    assert p.seconds.designs == pytest.approx(10.0)
    assert p.green_applications.designs == pytest.approx(10.0)
    assert p.seconds.low == pytest.approx(30 / 4)  # both queries the dearer one
    assert p.seconds.high == pytest.approx(30 / 2)


def test_queries_are_solvable_and_repeat(pretrained):
    first, again = (query_stream(pretrained.scene, 3, 4) for _ in range(2))
    assert [q.reynolds for q in first] == [q.reynolds for q in again]
    assert len({q.reynolds for q in first}) == 4
    assert all(len(q.candidates()) for q in first)


def test_payoff_plot_names_its_axes(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr("shapeopt.plot.plt.close", figures.append)
    plot_payoff(example_payoffs(), tmp_path / "payoff.png")
    labels = [axis.get_ylabel() for axis in figures[0].axes]
    assert labels == ["cumulative wall seconds", "cumulative applications of G"]


def test_what_does_not_fit_the_scene_is_refused(pretrained):
    elsewhere = dataclasses.replace(pretrained.scene, stream=Tunnel(16.0))
    with pytest.raises(InvalidInput, match="different scenes"):
        optimise(Problem(elsewhere, 20.0), pretrained)
    with pytest.raises(InvalidInput, match="reaches beyond"):
        verify(pretrained.scene, np.array([9.0, 0.0, 0.0, 0.0]), 20.0)


def test_payoff_plot_is_not_blank(tmp_path, capfd):
    path = plot_payoff(example_payoffs(), tmp_path / "payoff.png")
    pixels = pv.read(path).active_scalars
    assert len(np.unique(pixels, axis=0)) > 50
    assert capfd.readouterr().err == ""
