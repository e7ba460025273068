"""Gradients: Taylor tests (rate above 1.9), central differences, adjoints against tangents."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TINY

from surrogate import Flow, Scene, Tunnel, load
from surrogate.flow.loads import drag, drag_coefficient
from surrogate.flow.solver import steady, tangent
from surrogate.flow.solver.adjoint import Effort, slip_weights
from surrogate.flow.solver.newton import NewtonSettings

LENS = jnp.array([2.2, 0.12, -0.05, 0.03])
SCENE = Scene(reynolds=(0.5, 45), fidelity=TINY)
EXACT = NewtonSettings(tolerance=1e-10, linear_tolerance=1e-8)
UNBOUNDED = Flow(SCENE, EXACT)
DOMAIN = UNBOUNDED.domain
TUNNEL = Flow(dataclasses.replace(SCENE, stream=Tunnel(6.0)), EXACT)
DIRECTION = np.array([0.4, 0.1, -0.08, 0.05, 0.3])  # in shape and Re


def drag_and_gradient(drag):
    """Cd of a body at a Reynolds number, and its gradient in the parameters and in Re."""
    return jax.value_and_grad(drag, argnums=(0, 1))


def taylor_rates(drag, reynolds, steps):
    """Powers of the step at which the remainder of the tangent line falls from step to step."""

    def moved(step):
        return LENS + step * DIRECTION[:4], jnp.asarray(reynolds + step * DIRECTION[4])

    value, (shape, by_reynolds) = drag_and_gradient(drag)(*moved(0.0))
    slope = float(shape @ DIRECTION[:4] + by_reynolds * DIRECTION[4])
    remainders = [abs(float(drag(*moved(step)) - value) - step * slope) for step in steps]
    return np.log2(np.array(remainders[:-1]) / remainders[1:]), remainders


@pytest.mark.parametrize(
    ("flow", "reynolds"),  # at Re 16 the cell Reynolds number is 2 exactly
    [
        pytest.param(UNBOUNDED, 1.0, marks=pytest.mark.slow),
        (UNBOUNDED, 16.0),
        (UNBOUNDED, 40.0),
        (TUNNEL, 1.0),
        (TUNNEL, 40.0),
    ],
    ids=[
        "unbounded, Re 1",
        "unbounded, Re 16",
        "unbounded, Re 40",
        "tunnel, Re 1",
        "tunnel, Re 40",
    ],
)
def test_taylor_remainders_of_the_drag_are_of_second_order(flow, reynolds):
    """In shape and Re together, as the step is halved four times."""
    rates, remainders = taylor_rates(flow.drag, reynolds, 0.1 / 2.0 ** np.arange(5))
    assert rates[-1] > 1.9, f"remainders {remainders}, rates {rates}"


@pytest.mark.parametrize("reynolds", [2.0, 38.0])
def test_taylor_remainders_of_a_surrogate_are_of_second_order(reynolds):
    steps = 0.02 / 2.0 ** np.arange(5)
    rates, remainders = taylor_rates(jax.jit(load("pretrained").drag), reynolds, steps)
    assert rates[-1] > 1.9, f"remainders {remainders}, rates {rates}"


def test_central_differences_converge_to_the_gradient():
    """Their error falls with the step squared until the solver's tolerance takes over."""
    _, (shape, by_reynolds) = drag_and_gradient(UNBOUNDED.drag)(LENS, jnp.asarray(10.0))
    for k, expected in enumerate([*shape, by_reynolds]):
        direction = jnp.zeros(5).at[k].set(1.0 if k < 4 else 10.0)  # the size of what changes

        def drag(step, direction=direction):
            return float(UNBOUNDED.drag(LENS + step * direction[:4], 10.0 + step * direction[4]))

        slope = float(expected * direction[k])
        errors = [abs((drag(h) - drag(-h)) / (2 * h) / slope - 1) for h in (2e-2, 5e-3, 1e-3)]
        assert errors[0] < 0.1, f"parameter {k}: {errors}"
        assert errors[1] < errors[0] / 10, f"parameter {k}: {errors}"
        assert errors[2] < 5e-4, f"parameter {k}: {errors}"


@pytest.mark.parametrize("reynolds", [1.0, 40.0])
def test_the_slope_by_a_short_adjoint_solve_has_three_digits(reynolds):
    drag, (expected, _) = drag_and_gradient(UNBOUNDED.drag)(LENS, jnp.asarray(reynolds))
    quick = Flow(SCENE).loads_and_gradients(LENS, reynolds)
    assert bool(quick.converged)
    assert float(quick.drag) == pytest.approx(float(drag), rel=1e-5)
    error = float(jnp.linalg.norm(quick.gradient - expected) / jnp.linalg.norm(expected))
    assert error < 2e-3, f"error {error:.1e}"


@pytest.fixture(scope="module")
def driven():
    """A flow past the cylinder, driven by a traction that is not the body's."""
    tight = NewtonSettings(tolerance=1e-11, linear_tolerance=1e-8)
    cylinder, reynolds = jnp.asarray(SCENE.family.ellipse(1.0)), jnp.asarray(20.0, float)
    operators, solved, _ = UNBOUNDED.bodies.solved(cylinder, reynolds)

    @jax.jit
    def drive(amplitude):
        velocity, info = steady.forced_flow(
            DOMAIN, operators, amplitude, operators.response(amplitude), tight
        )
        state = steady.FlowState(velocity, amplitude)
        return state, steady.slip_residual(operators, state), info.converged

    state, _, converged = drive(0.9 * solved.amplitude)
    assert bool(converged)
    return operators, state, lambda amplitude: drive(amplitude)[1]


TIGHT = Effort(1e-6, 60)
ONE_STEP = NewtonSettings(max_steps=1, max_vectors=60, forcing=1e-6)


@pytest.fixture(scope="module")
def slip_jacobian(driven):
    operators, state, _ = driven
    matrix, cost = jax.jit(lambda: tangent.slip_jacobian(DOMAIN, operators, state, TIGHT))()
    assert bool(cost.converged)
    return matrix


def test_slip_jacobian_is_the_derivative_of_the_slip(driven, slip_jacobian):
    _, state, slip = driven
    step = 1e-5 * np.linspace(1, -1, state.amplitude.size)
    difference = (slip(state.amplitude + step) - slip(state.amplitude - step)) / 2
    assert np.allclose(difference, slip_jacobian @ step, atol=1e-11)


def test_slip_adjoint_agrees_with_the_slip_jacobian(driven, slip_jacobian):
    """And both with a central difference."""
    operators, state, slip = driven
    weights = jnp.linspace(-1, 2, state.amplitude.size)
    gradient, _ = jax.jit(lambda: tangent.slip_adjoint(DOMAIN, operators, state, weights, TIGHT))()
    assert np.allclose(gradient, slip_jacobian.T @ weights, rtol=1e-5, atol=1e-6)
    step = 1e-5 * np.cos(np.arange(state.amplitude.size))
    difference = weights @ (slip(state.amplitude + step) - slip(state.amplitude - step)) / 2
    assert float(gradient @ step) == pytest.approx(float(difference), abs=1e-10)


def test_load_weights_predict_the_newton_step(driven):
    """lambda . y is the drag that one Newton step removes, for the flow a traction drives."""
    operators, state, _ = driven

    @jax.jit
    def steps():
        weights, _ = slip_weights(drag, DOMAIN, operators, state, TIGHT)
        moved, _ = steady.body_flow(DOMAIN, operators, state, ONE_STEP)
        return weights, moved.amplitude, steady.slip_residual(operators, state)

    weights, moved, slip = steps()
    change = drag_coefficient(moved) - drag_coefficient(state.amplitude)
    assert float(weights @ slip) == pytest.approx(float(change), rel=1e-5)
