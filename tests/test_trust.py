"""The drag says how far it can be trusted: retraction, estimated error, status, refusal."""

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from surrogate.body.family import ellipse, family_shape
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.grid.immersed import bspline, retraction, ripple
from surrogate.flow.check.trust import judge, solve_shape
from surrogate.scene.scene import FIDELITIES, Tunnel, Unbounded

DRAFT = FIDELITIES["draft"]


def spline(wave):
    """Fourier transform of the cubic B-spline."""
    return np.sinc(wave / 2 / np.pi) ** 4


@pytest.mark.parametrize("degrees", [0.0, 12.0, 22.5, 35.0, 45.0])
def test_retraction_is_the_integral_it_stands_for(degrees):
    unit = np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
    step = 1e-3
    k = np.arange(step / 2, 800, step)
    eigenvalue = sum(4 * np.sin(k * n / 2) ** 2 for n in unit)
    smeared = (spline(k * unit[0]) * spline(k * unit[1])) ** 2 / eigenvalue
    expected = (np.sum(1 / k**2 - smeared) * step + 1 / k[-1]) / np.pi
    assert float(retraction(unit[None])[0]) == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("offset", [0.0, 0.2, 0.35, 0.5, 0.9])
def test_retraction_between_two_rows_is_the_mean_it_stands_for(offset):
    rows = np.arange(-3, 5)
    weights = np.asarray(bspline(rows - offset))
    expected = weights @ np.abs(rows[:, None] - rows) @ weights / 2
    found = float(retraction(np.array([[0.0, 1.0]]))[0] + ripple(np.array(offset)))
    assert found == pytest.approx(expected, abs=3e-4)


def test_a_resolved_body_is_accurate_and_says_how_much():
    shape = family_shape(ellipse(1.0))
    drag = solve_shape(shape, Unbounded(), DRAFT, 10.0).cd
    trust = judge(drag, shape, Unbounded(), DRAFT, 10.0)
    assert trust.status == "accurate"
    assert abs(drag / 2.754 - 1) < 2 * trust.estimated_error < 0.015


def test_a_wake_beyond_the_window_is_degraded():
    """A plate across the stream, its window held short."""
    short = dataclasses.replace(DRAFT, wake=0.0)
    shape = family_shape(ellipse(0.4))
    drag = solve_shape(shape, Unbounded(), short, 40.0).cd
    assert judge(drag, shape, Unbounded(), short, 40.0).status == "degraded"


def test_without_a_coarser_flow_there_is_no_estimate():
    shape = family_shape(ellipse(6.0))
    trust = judge(1.0, shape, Unbounded(), DRAFT, 10.0)
    assert trust.estimated_error is None
    assert trust.status == "degraded"


def test_windows_follow_the_wake():
    standard = FIDELITIES["standard"]
    assert standard.reaching(40.0, 1.0) == standard
    assert standard.reaching(45.0, 1.4).downstream > standard.downstream
    assert standard.reaching(300.0, 2.0).downstream <= 44


LOG_RANGES = (st.floats(np.log(1e-3), np.log(300)), st.floats(np.log(0.2), np.log(10)))


@pytest.mark.slow
@settings(max_examples=40, deadline=None, derandomize=True)
@given(*LOG_RANGES, st.sampled_from([5, 8, 10]), st.sampled_from([None, 2.5, 4.0, 16.0]))
def test_no_drag_called_accurate_is_wrong(log_re, log_aspect, cells, height):
    """Anywhere from Stokes flow to Re 300: refused, not found, degraded, or within its promise."""
    reynolds, shape = float(np.exp(log_re)), family_shape(ellipse(float(np.exp(log_aspect))))
    stream = Unbounded() if height is None else Tunnel(height)
    fidelity = dataclasses.replace(DRAFT, cells=cells)
    try:
        drag = solve_shape(shape, stream, fidelity, reynolds).cd
    except (InvalidInput, NotConverged):
        assume(False)
    assert np.isfinite(drag)
    if judge(drag, shape, stream, fidelity, reynolds).status == "accurate":
        reference = solve_shape(shape, stream, FIDELITIES["standard"], reynolds).cd
        assert abs(drag / reference - 1) < 2 * fidelity.promise + 0.004
