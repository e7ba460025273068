"""Training labels are those of solved flows, by one solve or by Newton steps a few at a time."""

import dataclasses

import numpy as np
import pytest
from conftest import TINY

from surrogate import Family, Scene
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.training.loop import make_setup
from surrogate.training.methods.inversion import FullSolve, Inversion, NewtonSteps
from surrogate.training.methods.sip import LabelRegression
from surrogate.training.plan import make_plan
from surrogate.training.step import compile_step, first_state

SECTIONS = Family(aspect=(1.5, 3), gamma2=(-0.2, 0.3), incidence=(-4, 12))
COUNT = 12
UNREACHABLE = NewtonSettings(1e-30, 2, 40)


@dataclasses.dataclass(frozen=True)
class Regression(LabelRegression):
    """Regression on labels of any inversion."""

    inversion: Inversion | None = None

    @property
    def evaluator(self) -> Inversion:
        """The inversion."""
        return self.inversion


@pytest.fixture(scope="module")
def setup():
    scene = Scene(family=SECTIONS, fidelity=TINY, reynolds=(5, 20))
    return make_setup(make_plan(scene, "sip", "quick", samples=COUNT, held_out=4))


def evaluated(setup, inversion):
    """The labels once none is pending, and the number of evaluations of all samples."""
    method, batch = Regression(inversion=inversion), np.arange(COUNT)
    state = first_state(method, setup.network, setup.physics)
    step, rounds = compile_step(method, state, setup.physics, batch), 0
    while np.any(state.labels.pending(batch)):
        state = [*step.evaluations(state, batch, np.zeros(COUNT, bool))][-1][0]
        rounds += 1
        assert rounds < 20
    return state.labels, rounds


@pytest.mark.slow
def test_newton_steps_end_at_the_loads_and_slopes_of_a_solve(setup):
    solved, once = evaluated(setup, FullSolve(slopes=True))
    stepped, several = evaluated(setup, NewtonSteps(slopes=True))
    assert (once, several > 1) == (1, True)
    assert np.all(solved.valid)
    assert np.all(stepped.valid)
    assert np.allclose(stepped.outputs, solved.outputs, rtol=0, atol=1e-4)
    assert np.allclose(stepped.slopes, solved.slopes, rtol=0, atol=2e-3)


def test_labels_are_the_loads_of_the_flow_solver(setup):
    found, _ = evaluated(setup, NewtonSteps())
    samples, flow = setup.physics.samples, setup.physics.flow
    loads = flow.solve_all(np.asarray(samples.parameters), np.asarray(samples.reynolds)).loads
    assert np.allclose(np.exp(found.outputs[:, 0]), loads[:, 0], rtol=1e-4)
    assert np.allclose(found.outputs[:, 1:], loads[:, 1:] / loads[:, :1], atol=1e-4)


@pytest.mark.slow
def test_a_label_whose_residual_stays_above_the_tolerance_is_left_out(setup):
    labels, _ = evaluated(setup, NewtonSteps(newton=UNREACHABLE))
    assert not np.any(labels.valid)
