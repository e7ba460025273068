"""Drag, lift and moment as functionals: Taylor tests of their adjoints, with and without walls."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TINY

from surrogate import Tunnel, Unbounded, family_shape
from surrogate.flow.grid.domain_2d import Domain2D
from surrogate.flow.loads import drag, drag_amplitude, drag_coefficient, lift, moment
from surrogate.flow.solver import steady
from surrogate.flow.solver.adjoint import Effort, by_stream, load_gradients
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.flow.surface.coefficients import force_coefficients

LOADS = {"drag": drag, "lift": lift, "moment": moment}
TIGHT = NewtonSettings(tolerance=1e-10)
EFFORT = Effort(1e-8, 60)
STEPS = 0.1 / 2.0 ** np.arange(5)
AT, DIRECTION = jnp.array([2.0, 0.1, 10.0, 8.0]), np.array([0.3, 0.1, 6.0, 0.8])

ALONE = pytest.param("unbounded", marks=pytest.mark.slow)  # as in the tests of camber


@pytest.fixture(scope="module", params=[ALONE, "tunnel"])
def domain(request):
    stream = Unbounded() if request.param == "unbounded" else Tunnel(4.0)
    return Domain2D.make(stream, TINY, (2.25, 1.5), symmetric=False)


@pytest.fixture(scope="module")
def evaluate(domain):
    """A load's name and a step from AT along DIRECTION to the load and its gradient there."""
    t = 2 * np.pi * np.arange(domain.nodes) / domain.nodes

    def contour(parameters):
        aspect, beta2, incidence = parameters
        y = (jnp.sin(t) + beta2 * jnp.sin(2 * t)) / (2 * jnp.sqrt(aspect))
        turned = jnp.deg2rad(incidence)
        c, s = jnp.cos(turned), jnp.sin(turned)
        points = jnp.stack([-jnp.sqrt(aspect) / 2 * jnp.cos(t), y], axis=1)
        return points @ jnp.array([[c, -s], [s, c]])

    @jax.jit
    def load_and_gradient(values, weights):
        """Of a weighted sum of the loads: one compiled adjoint serves them all."""

        def load(*arguments):
            return weights @ jnp.stack([one(*arguments) for one in LOADS.values()])

        parameters, reynolds = values[:-1], values[-1]
        operators = steady.assemble(domain, contour(parameters), reynolds)
        state, info = steady.body_flow(domain, operators, settings=TIGHT)
        value = load(domain.modes, state.amplitude, operators.markers)
        found = load_gradients((load,), domain, operators, state, reynolds, (EFFORT,))
        derivatives = steady.stream_derivatives(domain, reynolds)
        rest = by_stream(domain, operators, state, derivatives, found.adjoints, (EFFORT,))
        by_parameters = jax.vjp(contour, parameters)[1](found.by_markers[0])[0]
        gradient = jnp.append(by_parameters, found.by_reynolds[0] + rest[0])
        return value, gradient, info.converged & found.work.converged

    def at(name, step):
        weights = jnp.array([float(name == other) for other in LOADS])
        value, gradient, converged = load_and_gradient(AT + step * DIRECTION, weights)
        assert bool(converged)
        return value, gradient

    return at


@pytest.mark.parametrize("name", LOADS)
def test_taylor_of_every_load(evaluate, name):
    """Halve the step four times; the remainder of the tangent line must fall at second order."""
    value, gradient = evaluate(name, 0.0)
    slope = float(gradient @ DIRECTION)
    assert abs(slope) > 1e-3  # or the test would prove little
    remainders = [abs(float(evaluate(name, h)[0] - value) - h * slope) for h in STEPS]
    rates = np.log2(np.divide(remainders[:-1], remainders[1:]))
    assert rates[-1] > 1.9, f"remainders {remainders}, rates {rates}"


def test_exact_functionals_are_the_solvers_coefficients(domain):
    shape = family_shape({"aspect": 2.0}, 10.0)
    markers = shape.markers(domain.nodes)

    @jax.jit
    def flow(markers, reynolds):
        return steady.body_flow(domain, steady.assemble(domain, markers, reynolds))

    state, _ = flow(markers, jnp.asarray(5.0))
    found = force_coefficients(domain, markers, state, 5.0)
    for name, load in LOADS.items():
        value = float(load(domain.modes, state.amplitude, markers))
        assert value == pytest.approx(float(getattr(found, name)), rel=1e-12)


def test_exact_moment_of_a_force_at_an_offset():
    """A uniform traction along y on a contour shifted by s along x has the moment -s times it."""
    domain = Domain2D.make(Unbounded(), TINY, (1.5, 1.5), symmetric=False)
    circle = family_shape({"aspect": 1.0}).markers(domain.nodes)
    amplitude = jnp.zeros(domain.modes.count).at[domain.modes.lift_index].set(-0.7)
    shifted = circle + jnp.array([0.25, 0.0])
    assert float(lift(domain.modes, amplitude, shifted)) == pytest.approx(1.4)
    assert float(moment(domain.modes, amplitude, circle)) == pytest.approx(0, abs=1e-12)
    assert float(moment(domain.modes, amplitude, shifted)) == pytest.approx(-0.25 * 1.4)


def test_exact_drag_amplitude_is_the_inverse_of_the_drag():
    amplitude = jnp.array([-0.83, 0.2])
    assert float(drag_amplitude(drag_coefficient(amplitude))) == pytest.approx(-0.83)


@pytest.mark.slow
def test_forward_and_reverse_mode_of_the_drag_agree(tiny_scene):
    from surrogate import Flow

    flow, body = Flow(tiny_scene), jnp.array([2.2, 0.12, -0.05, 0.03])
    direction = jnp.array([0.3, 0.1, -0.2, 0.4])
    gradient = jax.grad(flow.drag)(body, 20.0)
    _, change = jax.jvp(lambda p: flow.drag(p, 20.0), (body,), (direction,))
    assert float(change) == pytest.approx(float(gradient @ direction), rel=1e-12)
    with pytest.raises(NotImplementedError, match="difference its gradient"):
        jax.hessian(flow.drag)(body, 20.0)


@pytest.mark.slow
def test_loads_of_a_symmetric_body_are_its_drag_alone(tiny_scene):
    from surrogate import Flow

    flow, body = Flow(tiny_scene), jnp.array([2.2, 0.12, -0.05, 0.03])
    loads = flow.loads(body, 20.0)
    assert loads.tolist() == [float(flow.drag(body, 20.0)), 0.0, 0.0]
    by_body, by_reynolds = jax.jacobian(flow.loads, (0, 1))(body, 20.0)
    assert by_body.shape == (3, 4)
    assert by_reynolds.shape == (3,)
    np.testing.assert_allclose(by_body[0], jax.grad(flow.drag)(body, 20.0), rtol=1e-9)
    assert not np.any(by_body[1:])
    assert not np.any(by_reynolds[1:])
    assert np.isnan(jax.jit(flow.loads)(body, 200.0)).all()  # outside the scene's range
