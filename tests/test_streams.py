"""Operators of the stream are kept for the Reynolds numbers asked last, and mixed up with none."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TINY

from surrogate import Flow, Scene, Tunnel
from surrogate.checks import traced
from surrogate.flow import programs
from surrogate.flow.streams import KEPT, forget_operators, kept_operators

LENS, EGG = np.array([2.0, 0.1, 0.0, 0.0]), np.array([1.5, 0.0, 0.1, 0.0])
FLOW = Flow(Scene(fidelity=TINY))


@pytest.fixture
def computed(monkeypatch):
    """The names of the operators computed, not traced, in the test; nothing is kept before."""
    forget_operators()
    seen = []

    def count(name):
        compute = getattr(programs, name)

        def counted(*arguments):
            found = compute(*arguments)
            if not traced(*jax.tree.leaves(found)):
                seen.append(name)
            return found

        monkeypatch.setattr(programs, name, counted)

    count("stream_operators")
    count("stream_derivatives")
    return seen


def test_bodies_at_one_reynolds_number_share_them(computed):
    drags = [float(FLOW.drag(body, 10.0)) for body in (LENS, EGG)]
    assert drags[0] != drags[1]
    found = [FLOW.loads_and_gradients(body, 10.0) for body in (LENS, EGG)]
    assert [float(one.drag) for one in found] == drags
    assert computed == ["stream_operators", "stream_derivatives"]
    forget_operators()
    alone = FLOW.loads_and_gradients(EGG, 10.0)
    np.testing.assert_array_equal(alone.gradients, found[1].gradients)
    np.testing.assert_array_equal(alone.by_reynolds, found[1].by_reynolds)


def test_those_of_the_last_numbers_and_streams_are_kept(computed):
    first = float(FLOW.drag(LENS, 10.0))
    tunnel = Flow(Scene(Tunnel(6.0), fidelity=TINY))
    assert float(tunnel.drag(LENS, 10.0)) > first > float(FLOW.drag(LENS, 11.0))
    assert float(FLOW.drag(LENS, 10.0)) == first
    assert len(computed) == KEPT == 3
    FLOW.drag(LENS, 12.0)
    tunnel.drag(LENS, 10.0)  # the one not asked for longest was dropped
    assert len(computed) == 5


TRACED = {  # drags of a body at a Reynolds number, in functions that JAX traces
    "body": lambda body, re: jax.jit(lambda body: FLOW.drag(body, re))(body),
    "reynolds": lambda body, re: jax.jit(lambda re: FLOW.drag(LENS, re))(re),
    "loads": lambda body, re: jax.jit(lambda body: FLOW.loads_and_gradients(body, re).drag)(body),
    "gradient": lambda body, re: jax.jit(jax.value_and_grad(lambda body: FLOW.drag(body, re)))(
        body
    )[0],
}


@pytest.mark.parametrize(
    "reynolds", [10.0, pytest.param(jnp.asarray(10.0), marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "drag",
    [
        pytest.param(drag, id=name, marks=() if name == "gradient" else pytest.mark.slow)
        for name, drag in TRACED.items()
    ],
)
def test_nothing_that_is_traced_is_kept(computed, drag, reynolds):
    """Neither where JAX traces the body nor where it traces Re."""
    traced = drag(jnp.asarray(LENS), reynolds)
    assert not computed
    expected = float(FLOW.drag(LENS, reynolds))
    assert computed == ["stream_operators"]
    assert float(traced) == pytest.approx(expected, rel=1e-8)


def test_nothing_is_kept_while_another_function_is_traced(computed):
    reynolds = jnp.asarray(10.0)
    around = jax.jit(lambda x: x * kept_operators(FLOW.domain, reynolds).far.sum())(2.0)
    assert not computed
    kept = kept_operators(FLOW.domain, reynolds)
    assert computed == ["stream_operators"]
    assert float(around) == pytest.approx(2 * float(kept.far.sum()), rel=1e-6)


def test_a_gradient_in_the_body_alone_takes_no_derivatives_of_the_stream(computed):
    both = jax.grad(FLOW.drag, argnums=(0, 1))(jnp.asarray(LENS), 10.0)
    assert computed.count("stream_derivatives") == 1
    alone = jax.grad(FLOW.drag)(jnp.asarray(LENS), 10.0)
    np.testing.assert_allclose(alone, both[0], rtol=1e-6)
    _, moved = jax.jvp(lambda body: FLOW.drag(body, 10.0), (LENS,), (np.ones(4),))
    assert float(moved) == pytest.approx(float(alone.sum()), rel=1e-6)
    assert computed.count("stream_derivatives") == 1
    by_reynolds = jax.grad(lambda reynolds: FLOW.drag(LENS, reynolds))(10.0)
    assert float(by_reynolds) == pytest.approx(float(both[1]), rel=1e-6)
