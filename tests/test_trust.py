"""The drag says how far it can be trusted: retraction, estimated error, status, refusal."""

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from surrogate import (
    FIDELITIES,
    Flow,
    InvalidInput,
    NotConverged,
    Scene,
    Tunnel,
    Unbounded,
    family_shape,
)
from surrogate.flow.check.error_estimate import DragAndLift, estimate_error
from surrogate.flow.grid.immersed import bspline
from surrogate.flow.grid.retraction import offset_correction, retraction

DRAFT = FIDELITIES["draft"]


def spline(wave):
    """Fourier transform of the cubic B-spline."""
    return np.sinc(wave / 2 / np.pi) ** 4


@pytest.mark.parametrize("degrees", [0.0, 12.0, 22.5, 35.0, 45.0])
def test_exact_retraction_is_the_integral_it_stands_for(degrees):
    unit = np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
    step = 1e-3
    k = np.arange(step / 2, 800, step)
    eigenvalue = sum(4 * np.sin(k * n / 2) ** 2 for n in unit)
    smeared = (spline(k * unit[0]) * spline(k * unit[1])) ** 2 / eigenvalue
    expected = (np.sum(1 / k**2 - smeared) * step + 1 / k[-1]) / np.pi
    assert float(retraction(unit[None])[0]) == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("offset", [0.0, 0.2, 0.35, 0.5, 0.9])
def test_exact_retraction_between_two_rows_is_the_mean_it_stands_for(offset):
    rows = np.arange(-3, 5)
    weights = np.asarray(bspline(rows - offset))
    expected = weights @ np.abs(rows[:, None] - rows) @ weights / 2
    found = float(retraction(np.array([[0.0, 1.0]]))[0] + offset_correction(np.array(offset)))
    assert found == pytest.approx(expected, abs=3e-4)


def ellipse(aspect):
    return family_shape({"aspect": aspect})


def test_a_resolved_body_is_accurate_and_says_how_much():
    found = Flow(Scene(fidelity=DRAFT)).solve(ellipse(1.0), 10.0)
    assert found.status == "accurate"
    assert abs(found.drag / 2.754 - 1) < found.estimated_error < 0.015


@pytest.mark.parametrize(("cells", "extrapolated"), [(24, 2.0), (16, None)])
def test_exact_extrapolation_of_second_order(cells, extrapolated):
    """None where the coarser grid has few cells."""

    def solve(fidelity):
        return DragAndLift(2 - 20 / fidelity.cells**2, 0.0)

    fidelity = dataclasses.replace(DRAFT, cells=cells)
    found = estimate_error(solve(fidelity), solve, fidelity, 1.0, 1.0, 2)
    assert found.extrapolated_drag == (extrapolated and pytest.approx(extrapolated))


@pytest.mark.parametrize(("reynolds", "order"), [(0.01, 3.0), (40.0, 2.5), (300.0, 2.0)])
def test_exact_orders_in_space_fall_as_boundary_layers_thin(reynolds, order):
    def solve(fidelity):
        return DragAndLift(2 - 20 / fidelity.cells**order, 0.0)

    fidelity = dataclasses.replace(DRAFT, cells=24)
    found = estimate_error(solve(fidelity), solve, fidelity, reynolds, 1.0, 3)
    assert found.extrapolated_drag == pytest.approx(2.0, abs=2e-4 if reynolds == 300 else 1e-9)


@pytest.mark.parametrize(
    ("reynolds", "error", "status"),
    [
        (1.0, 0.9, "accurate"),
        (1.0, 1.1, "degraded"),
        (300.0, 0.35, "accurate"),
        (300.0, 0.45, "degraded"),
    ],
)
def test_thin_boundary_layers_in_space_ask_for_more(reynolds, error, status):
    """By the share of its promise that a drag is likely to be off."""
    order = 3 if reynolds == 1 else 2

    def solve(fidelity):
        return DragAndLift(1 + error * DRAFT.promise * (24 / fidelity.cells) ** order, 0.0)

    fidelity = dataclasses.replace(DRAFT, cells=24)
    assert estimate_error(solve(fidelity), solve, fidelity, reynolds, 1.6, 3).status == status
    assert estimate_error(solve(fidelity), solve, fidelity, reynolds, 1.7, 3).status == "degraded"


def test_a_wake_beyond_the_window_is_degraded():
    """A plate across the stream, its window held short."""
    short = dataclasses.replace(DRAFT, wake=0.0)
    found = Flow(Scene(fidelity=short)).solve(ellipse(0.4), 40.0, allow_unsteady=True)
    assert found.status == "degraded"
    assert found.estimated_error > DRAFT.promise


def test_without_a_coarser_flow_there_is_no_estimate():
    found = Flow(Scene(fidelity=DRAFT)).solve(ellipse(6.0), 10.0)
    assert found.estimated_error is None
    assert found.status == "degraded"


@pytest.mark.parametrize("cells", [4, 5, 6, 7, 8, 10, 16, 128])
def test_coarser_has_fewer_cells_and_enough_if_it_can(cells):
    coarser = dataclasses.replace(DRAFT, cells=cells, height=4).coarser().cells
    assert coarser < cells
    assert coarser >= min(6, cells - 2)
    assert coarser == round(2 * cells / 3) or cells < 9


def test_windows_follow_the_wake():
    standard = FIDELITIES["standard"]
    assert standard.for_wake(40.0, 1.0) == standard
    assert standard.for_wake(45.0, 1.4).downstream > standard.downstream
    assert standard.for_wake(300.0, 2.0).downstream == 40  # the longest


LOG_RANGES = (st.floats(np.log(1e-3), np.log(300)), st.floats(np.log(0.2), np.log(10)))


@pytest.mark.slow
@settings(max_examples=40, deadline=None, derandomize=True)
@given(*LOG_RANGES, st.sampled_from([5, 8, 10]), st.sampled_from([None, 2.5, 4.0, 16.0]))
def test_robust_no_drag_called_accurate_is_wrong(log_re, log_aspect, cells, height):
    """Anywhere from Stokes flow to Re 300: refused, not found, degraded, or within its promise."""
    reynolds, shape = float(np.exp(log_re)), ellipse(float(np.exp(log_aspect)))
    stream = Unbounded() if height is None else Tunnel(height)
    draft = Flow(Scene(stream=stream, fidelity=dataclasses.replace(DRAFT, cells=cells)))
    try:
        found = draft.solve(shape, reynolds, allow_unsteady=True)
    except (InvalidInput, NotConverged):
        assume(False)
    assert np.isfinite(found.drag)
    if found.status == "accurate":
        reference = Flow(Scene(stream=stream)).solve(
            shape, reynolds, estimate=False, allow_unsteady=True
        )
        assert abs(found.drag / reference.drag - 1) < 2 * DRAFT.promise + 0.004
