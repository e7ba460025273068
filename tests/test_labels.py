"""Training labels are those of solved flows, by one solve or by Newton steps a few at a time."""

import dataclasses

import numpy as np
import pytest
from conftest import SECTIONS, TINY

from surrogate import Scene
from surrogate.training.methods.inversion import LABEL_STEPS, FullSolve, Inversion, NewtonSteps
from surrogate.training.methods.labels import no_labels
from surrogate.training.methods.sip import LabelRegression
from surrogate.training.plan import make_plan
from surrogate.training.setup import make_setup
from surrogate.training.step import compile_step, first_state

COUNT = 6
UNREACHABLE = LABEL_STEPS._replace(tolerance=1e-30)


@dataclasses.dataclass(frozen=True)
class Regression(LabelRegression):
    """Regression on labels of any inversion."""

    inversion: Inversion = dataclasses.field(default_factory=FullSolve)

    @property
    def evaluator(self) -> Inversion:
        """The inversion."""
        return self.inversion


@pytest.fixture(scope="module")
def setup():
    scene = Scene(family=SECTIONS, fidelity=TINY, reynolds=(5, 20))
    return make_setup(make_plan(scene, "sip", "quick", samples=COUNT, held_out=COUNT))


def evaluated(setup, inversion):
    """The labels once none is pending, valid ones after each evaluation of all, and failures."""
    method, batch = Regression(inversion=inversion), np.arange(COUNT)
    state = first_state(method, setup.network, setup.physics)
    step, valid, failed = compile_step(method, state, setup.physics, batch), [], 0
    while np.any(state.labels.pending(batch)):
        parts = [*step.evaluations(state, batch, np.zeros(COUNT, bool))]
        state, failed = parts[-1][0], failed + sum(int(cost.failed) for *_, cost in parts)
        valid.append(int(np.sum(state.labels.valid)))
        assert len(valid) < 20
    return state.labels, valid, failed


@pytest.mark.slow
def test_newton_steps_end_at_the_loads_and_slopes_of_a_solve(setup):
    solved, once, lost = evaluated(setup, FullSolve(slopes=True))
    stepped, several, none = evaluated(setup, NewtonSteps(slopes=True))
    assert (once, lost, none) == ([COUNT], 0, 0)
    assert len(several) > 1
    assert np.all(stepped.valid)
    assert np.allclose(stepped.outputs, solved.outputs, rtol=0, atol=1e-4)
    assert np.allclose(stepped.slopes, solved.slopes, rtol=0, atol=2e-3)


def test_labels_are_the_loads_of_the_flow_solver(setup):
    found, valid, failed = evaluated(setup, NewtonSteps())
    assert (valid[-1], failed) == (COUNT, 0)
    samples, flow = setup.physics.samples, setup.physics.flow
    loads = flow.solve_all(np.asarray(samples.parameters), np.asarray(samples.reynolds)).loads
    assert np.allclose(np.exp(found.outputs[:, 0]), loads[:, 0], rtol=1e-4)
    assert np.allclose(found.outputs[:, 1:], loads[:, 1:] / loads[:, :1], atol=1e-4)


@pytest.mark.slow
def test_a_label_whose_residual_stays_above_the_tolerance_is_withdrawn(setup):
    _, valid, failed = evaluated(setup, NewtonSteps(newton=UNREACHABLE))
    assert (valid[0], valid[-1]) == (COUNT, 0)
    assert failed == COUNT


@pytest.mark.slow
def test_published_sip_keeps_the_last_label_and_tries_again(setup):
    """From predictions that are far from the traction two steps do not reach the tolerance."""
    method, batch = Regression(inversion=NewtonSteps(from_prediction=True)), np.arange(COUNT)
    state = first_state(method, setup.network, setup.physics)
    step = compile_step(method, state, setup.physics, batch)
    for _ in range(2):
        *_, (state, *_) = step.evaluations(state, batch, np.zeros(COUNT, bool))
    assert np.all(state.labels.valid)
    assert np.any(state.labels.pending(batch))


def test_progress_counts_flows_that_are_solved_and_begun(setup):
    labels = no_labels(setup.physics)
    assert labels.progress == "flows 0 of 6"
    begun = labels._replace(valid=np.arange(COUNT) < 4)
    assert begun.progress == "flows 0 of 6, 4 begun"
    assert begun._replace(converged=np.arange(COUNT) < 4).progress == "flows 4 of 6"
